#include "boxVelocity.H"

#include <mpi.h>

namespace
{
    //- Room before a row, and after it up to the next multiple
    constexpr Foam::label margin = 8;
}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::boxVelocity::boxVelocity(const slab& cells, const label reach)
:
    cells_(cells),
    nx_(cells.n().x()),
    ny_(cells.n().y()),
    nz_(cells.layers()),
    reach_(reach),
    rowStride_(margin*((nx_ + margin - 1)/margin + 2)),
    planeStride_(ny_*rowStride_),
    storage_
    (
        3*planeStride_*(nz_ + (Pstream::parRun() ? 2*reach : 0)) + 2*margin,
        Zero
    ),
    // FFTW and vectors like aligned rows
    first_
    (
        storage_.begin()
      + (margin - (reinterpret_cast<size_t>(storage_.begin())/8) % margin)
      + margin
    ),
    cellAt_(cells.places().size())
{
    bool inOrder = true;
    forAll(cells.places(), celli)
    {
        const Vector<label>& i = cells.places()[celli];
        const label place = i.x() + nx_*(i.y() + ny_*i.z());
        cellAt_[place] = celli;
        inOrder = inOrder && place == celli;
    }
    if (inOrder)
    {
        cellAt_.clear();
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::kernels::neighbourhood Foam::boxVelocity::around
(
    const label z,
    const label y
) const
{
    kernels::neighbourhood rows;

    for (label c = 0; c < 3; ++c)
    for (label m = -reach_; m <= reach_; ++m)
    {
        rows.y[c][kernels::maxReach + m] = row(z, c, y + m);
        rows.z[c][kernels::maxReach + m] = row(z + m, c, y);
    }

    return rows;
}


void Foam::boxVelocity::closeRows(const label z)
{
    for (label c = 0; c < 3; ++c)
    {
        double* row = plane(z, c);
        for (label y = 0; y < ny_; ++y, row += rowStride_)
        {
            for (label m = 1; m <= reach_; ++m)
            {
                row[-m] = row[nx_ - m];
                row[nx_ + m - 1] = row[m - 1];
            }
        }
    }
}


void Foam::boxVelocity::exchange()
{
    if (!Pstream::parRun())
    {
        return;
    }

    // ranks without layers have no part in it
    const label ranks = (cells_.n().z() + cells_.block() - 1)/cells_.block();
    const label me = Pstream::myProcNo();
    if (me >= ranks)
    {
        return;
    }
    const int before = (me + ranks - 1) % ranks;
    const int after = (me + 1) % ranks;
    const int size = 3*reach_*planeStride_;
    const label last = nz_ - reach_;

    // planes begin with the margin before their first row
    const auto start = [&](const label z) { return plane(z, 0) - margin; };

    MPI_Sendrecv
    (
        start(last), size, MPI_DOUBLE, after, 1,
        start(-reach_), size, MPI_DOUBLE, before, 1,
        MPI_COMM_WORLD, MPI_STATUS_IGNORE
    );
    MPI_Sendrecv
    (
        start(0), size, MPI_DOUBLE, before, 2,
        start(nz_), size, MPI_DOUBLE, after, 2,
        MPI_COMM_WORLD, MPI_STATUS_IGNORE
    );
}


void Foam::boxVelocity::store(const label z, vectorField& U) const
{
    for (label y = 0; y < ny_; ++y)
    {
        const double* u = row(z, 0, y);
        const double* v = row(z, 1, y);
        const double* w = row(z, 2, y);

        if (inOrder())
        {
            vector* cells = U.begin() + cell(z, y, 0);
            for (label x = 0; x < nx_; ++x)
            {
                cells[x] = vector(u[x], v[x], w[x]);
            }
            continue;
        }
        for (label x = 0; x < nx_; ++x)
        {
            U[cell(z, y, x)] = vector(u[x], v[x], w[x]);
        }
    }
}


void Foam::boxVelocity::load
(
    const vectorField& U,
    const label z,
    const label component,
    double* plane
) const
{
    for (label y = 0; y < ny_; ++y)
    for (label x = 0; x < nx_; ++x)
    {
        *plane++ = U[cell(z, y, x)][component];
    }
}


Foam::scalar Foam::boxVelocity::distance(const vectorField& U) const
{
    scalar largest = 0;

    for (label z = 0; z < nz_; ++z)
    for (label c = 0; c < 3; ++c)
    for (label y = 0; y < ny_; ++y)
    {
        const double* u = row(z, c, y);
        for (label x = 0; x < nx_; ++x)
        {
            const scalar d = mag(U[cell(z, y, x)][c] - u[x]);
            largest = d > largest || std::isnan(d) ? d : largest;
        }
    }

    return returnReduce(largest, maxOp<scalar>());
}


void Foam::boxVelocity::fluxes
(
    const scalarList& faceWeights,
    surfaceScalarField& phi
) const
{
    const fvMesh& mesh = phi.mesh();
    const uniformBox& box = uniformBox::New(mesh);
    const vectorField& areas = mesh.faceAreas();

    // the face lies between the places i and i + 1 in its direction
    const auto flux = [&](const label facei)
    {
        const direction d = box.normal(facei);
        const scalar area = areas[facei][d];
        Vector<label> i(cells_.places()[mesh.faceOwner()[facei]]);
        i[d] -= (area < 0);

        scalar value = 0;
        forAll(faceWeights, m)
        {
            Vector<label> low(i), high(i);
            low[d] -= m;
            high[d] += m + 1;
            value +=
                faceWeights[m]
               *(
                    row(low.z(), d, low.y())[low.x()]
                  + row(high.z(), d, high.y())[high.x()]
                );
        }
        return area*value;
    };

    scalarField& inside = phi.primitiveFieldRef();
    forAll(inside, facei)
    {
        inside[facei] = flux(facei);
    }
    for (fvsPatchScalarField& values : phi.boundaryFieldRef())
    {
        const label start = values.patch().start();
        forAll(values, i)
        {
            values[i] = flux(start + i);
        }
    }
}

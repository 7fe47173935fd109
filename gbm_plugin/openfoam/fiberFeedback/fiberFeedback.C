#include "fiberFeedback.H"
#include "addToRunTimeSelectionTable.H"
#include "fvMatrices.H"
#include "fvOptions.H"
#include "uniformBox.H"

namespace Foam
{
namespace fv
{
    defineTypeNameAndDebug(fiberFeedback, 0);
    addToRunTimeSelectionTable(option, fiberFeedback, dictionary);
}
}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::fv::fiberFeedback::fiberFeedback
(
    const word& name,
    const word& modelType,
    const dictionary& dict,
    const fvMesh& mesh
)
:
    incompressibleSource(name, modelType, dict, mesh),
    force_
    (
        IOobject
        (
            "fiberForce",
            mesh.time().timeName(),
            mesh,
            IOobject::READ_IF_PRESENT,
            IOobject::AUTO_WRITE
        ),
        mesh,
        dimensionedVector(dimAcceleration, Zero)
    ),
    step_(-1),
    hasBefore_(false),
    restarted_
    (
        IOobject
        (
            "fiberForce",
            mesh.time().timeName(),
            mesh,
            IOobject::MUST_READ,
            IOobject::NO_WRITE,
            false
        ).typeHeaderOk<volVectorField>(true)
    ),
    used_(-1),
    looked_
    (
        Pstream::parRun()
     || mesh.time().controlDict().subOrEmptyDict("functions").size() > 1
    ),
    firstLayer_(0)
{
    option::read(dict);
    fieldNames_.setSize(1, coeffs_.lookupOrDefault<word>("U", "U"));
    applied_.setSize(1, false);
}


Foam::fv::fiberFeedback& Foam::fv::fiberFeedback::addTo
(
    const fvMesh& mesh,
    const word& UName
)
{
    optionList& all = options::New(mesh);

    forAll(all, i)
    {
        if (isA<fiberFeedback>(all[i]))
        {
            refCast<fiberFeedback>(all[i]).refuse();
        }
    }

    dictionary dict;
    dict.add("type", typeName);
    dict.add("U", UName);
    all.append(option::New(typeName, dict, mesh));

    return refCast<fiberFeedback>(all.last());
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::fv::fiberFeedback::refuse() const
{
    FatalErrorInFunction
        << "fvOptions has the entry " << name_ << " of type " << typeName
        << ": take it out. Whether fibers act on the flow is said by the entry"
        << " feedback of constant/fiberProperties, coupling" << exit(FatalError);
}


void Foam::fv::fiberFeedback::layOut()
{
    const uniformBox& box = uniformBox::New(mesh_);
    const Vector<label>& n = box.cells();
    const label layer = n.x()*n.y();

    firstLayer_ = labelMax;
    for (label celli = 0; celli < mesh_.nCells(); ++celli)
    {
        firstLayer_ = min(firstLayer_, box.place(celli).z());
    }
    cells_.setSize(mesh_.nCells(), -1);
    for (label celli = 0; celli < mesh_.nCells(); ++celli)
    {
        const Vector<label> p(box.place(celli));
        cells_[p.x() + n.x()*p.y() + layer*(p.z() - firstLayer_)] = celli;
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::fv::fiberFeedback::renewed(const label step)
{
    hasBefore_ = step_ != -1 || restarted_;
    if (!isExplicit())
    {
        before_.swap(force_.primitiveFieldRef());
        filledBefore_.swap(filled_);
    }
    // values of processor patches are read by who takes differences of the
    // field, those of cyclic ones by function objects alone
    if (looked_)
    {
        force_.correctBoundaryConditions();
    }
    step_ = step;
}


void Foam::fv::fiberFeedback::addSup(fvMatrix<vector>& eqn, const label)
{
    if (!renew_)
    {
        refuse();
    }
    const label index = mesh_.time().timeIndex();
    if (step_ != index - 1)
    {
        FatalErrorInFunction
            << "the force of the fibers is of step " << step_ << ", and step "
            << index << " needs that of step " << index - 1
            << exit(FatalError);
    }
    used_ = index;

    const scalarField& V = mesh_.V();
    const vectorField& now = force_.primitiveField();
    vectorField& source = eqn.source();

    forAll(V, celli)
    {
        source[celli] -=
            V[celli]
           *(hasBefore_ ? 2*now[celli] - before_[celli] : now[celli]);
    }
}


void Foam::fv::fiberFeedback::beginRate(const flowStatistics&)
{
    if (!renew_)
    {
        refuse();
    }
    const label index = mesh_.time().timeIndex();
    if (!isExplicit())
    {
        layOut();
    }
    if (step_ != index)
    {
        renew_();
    }
    used_ = index;
}


void Foam::fv::fiberFeedback::addRate(const latticeLayer& layer)
{
    const label size = layer.n.x()*layer.n.y();
    const label* cells = cells_.cdata() + size*(layer.k - firstLayer_);
    const vectorField& f = force_.primitiveField();

    for (label i = 0; i < size; ++i)
    {
        if (!filled_[cells[i]])
        {
            continue;
        }
        const vector& own = f[cells[i]];
        for (direction c = 0; c < vector::nComponents; ++c)
        {
            layer.rate[c][i] += own[c];
        }
    }
}

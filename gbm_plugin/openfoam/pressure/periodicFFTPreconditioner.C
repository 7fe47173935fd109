#include "periodicFFTPreconditioner.H"

namespace Foam
{
    defineTypeNameAndDebug(periodicFFTPreconditioner, 0);

    lduMatrix::preconditioner::
        addsymMatrixConstructorToTable<periodicFFTPreconditioner>
        addperiodicFFTPreconditionerSymMatrixConstructorToTable_;
}

namespace
{

const Foam::fvMesh& meshOf(const Foam::lduMatrix& matrix)
{
    const auto* mesh = dynamic_cast<const Foam::fvMesh*>(&matrix.mesh());

    if (!mesh)
    {
        FatalErrorInFunction
            << "periodicFFT preconditions the equation of a mesh, and not"
            << " a coarser level of it: use it in PCG, not within GAMG"
            << Foam::exit(Foam::FatalError);
    }

    return *mesh;
}

}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::periodicFFTPreconditioner::periodicFFTPreconditioner
(
    const lduMatrix::solver& solver,
    const dictionary&
)
:
    lduMatrix::preconditioner(solver),
    laplacian_(periodicLaplacian::New(meshOf(solver.matrix()))),
    coefficients_
    (
        laplacian_.meanCoefficients
        (
            solver.matrix(),
            solver.interfaceBouCoeffs(),
            solver.interfaces()
        )
    ),
    weights_(solver.matrix().diag().size())
{
    solver.matrix().sumA
    (
        weights_,
        solver.interfaceBouCoeffs(),
        solver.interfaces()
    );
    sum_ = gSum(weights_);

    // rounding leaves something of row sums that are zero
    if (mag(sum_) > 1e-6*cmptMax(cmptMag(coefficients_)))
    {
        weights_ /= sum_;
    }
    else
    {
        weights_ = 0;
        sum_ = 0;
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::periodicFFTPreconditioner::precondition
(
    solveScalarField& wA,
    const solveScalarField& rA,
    const direction
) const
{
    const solveScalar s = gSum(rA);

    forAll(wA, celli)
    {
        wA[celli] = rA[celli] - s*weights_[celli];
    }

    laplacian_.solve(wA, coefficients_);

    if (sum_)
    {
        wA += s/sum_ - gSumProd(weights_, wA);
    }
}

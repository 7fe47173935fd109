#include "consistentStart.H"
#include "fvc.H"
#include "surfaceFields.H"
#include "volFields.H"

void Foam::consistentStart
(
    const fvMesh& mesh,
    const word& UName,
    const word& phiName
)
{
    volVectorField* U = mesh.getObjectPtr<volVectorField>(UName);

    if (!Pstream::parRun() || !U)
    {
        return;
    }

    volVectorField* old = U;
    for (label i = U->nOldTimes(); i >= 0; --i)
    {
        old->correctBoundaryConditions();
        old = i ? &old->oldTime() : old;
    }

    surfaceScalarField* phi = mesh.getObjectPtr<surfaceScalarField>(phiName);

    if (phi)
    {
        IOobject file
        (
            phiName,
            mesh.time().timeName(),
            mesh,
            IOobject::MUST_READ,
            IOobject::NO_WRITE,
            false
        );

        if (!file.typeHeaderOk<surfaceScalarField>(false))
        {
            *phi = fvc::flux(*U);
        }
    }
}

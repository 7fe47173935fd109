#include "consistentStart.H"
#include "fvc.H"
#include "surfaceFields.H"
#include "volFields.H"

namespace
{

//- The fields that were read, and their old times
template<class Type>
void correctBoundaries(const Foam::fvMesh& mesh)
{
    using namespace Foam;
    typedef GeometricField<Type, fvPatchField, volMesh> fieldType;

    for (const word& name : mesh.sortedNames<fieldType>())
    {
        fieldType* field = mesh.getObjectPtr<fieldType>(name);

        for (label older = field->nOldTimes(); older >= 0; --older)
        {
            field->correctBoundaryConditions();
            field = older ? &field->oldTime() : field;
        }
    }
}

}


void Foam::consistentStart
(
    const fvMesh& mesh,
    const word& UName,
    const word& phiName
)
{
    if (!Pstream::parRun())
    {
        return;
    }

    correctBoundaries<scalar>(mesh);
    correctBoundaries<vector>(mesh);

    const volVectorField* U = mesh.findObject<volVectorField>(UName);
    surfaceScalarField* phi = mesh.getObjectPtr<surfaceScalarField>(phiName);

    if (U && phi)
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

        // each rank looks for its own file
        if
        (
            !returnReduce
            (
                file.typeHeaderOk<surfaceScalarField>(false),
                andOp<bool>()
            )
        )
        {
            *phi = fvc::flux(*U);
        }
    }
}

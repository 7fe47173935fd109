#include "schemeSampler.H"
#include "fvc.H"
#include "interpolation.H"

namespace
{

using namespace Foam;

//- Values of a field at points, in lists of 'stride' numbers from 'start' on
template<class Type>
void interpolate
(
    const word& scheme,
    const GeometricField<Type, fvPatchField, volMesh>& field,
    const beadExchange& beads,
    scalar* out,
    const label stride
)
{
    const autoPtr<interpolation<Type>> values
    (
        interpolation<Type>::New(scheme, field)
    );

    forAll(beads.points(), i)
    {
        const Type value
        (
            values->interpolate(beads.points()[i], beads.cells()[i])
        );
        for (direction c = 0; c < pTraits<Type>::nComponents; ++c)
        {
            out[beads.placeOf(i)*stride + c] = value[c];
        }
    }
}

}


Foam::scalarList Foam::schemeSampler::sample
(
    const ambient wanted,
    const beadExchange& beads
) const
{
    const volVectorField& U = *U_;
    const label stride = 3 + components(wanted);
    scalarList values(beads.nPlaces()*stride);
    scalar* out = values.begin();

    interpolate(scheme_, U, beads, out, stride);

    if (wanted == ROTATION)
    {
        const volVectorField rotation(0.5*fvc::curl(U));
        interpolate(scheme_, rotation, beads, out + 3, stride);
    }
    else if (wanted == GRADIENT)
    {
        // OpenFOAM's gradient is the transpose of du_i/dx_j
        const volTensorField gradient(fvc::grad(U)().T());
        interpolate(scheme_, gradient, beads, out + 3, stride);
    }

    return values;
}


void Foam::schemeSampler::spread
(
    const UList<scalar>&,
    const beadExchange&,
    vectorField&,
    filledParts&
) const
{
    FatalErrorInFunction
        << "feedback of fibers is spread with the weights of their sampling,"
        << " which interpolation " << scheme_ << " does not give; allowed:"
        << " trilinear cubic quintic" << exit(FatalError);
}

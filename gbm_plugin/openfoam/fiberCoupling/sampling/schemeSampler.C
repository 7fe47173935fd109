#include "schemeSampler.H"
#include "interpolation.H"

Foam::schemeSampler::schemeSampler
(
    const word& scheme,
    const fvMesh& mesh,
    const periodicBox& box,
    autoPtr<lattice>&& places
)
:
    sampler(mesh, box, std::move(places)),
    scheme_(scheme)
{}


template<class Type>
Foam::Field<Type> Foam::schemeSampler::interpolate
(
    const GeometricField<Type, fvPatchField, volMesh>& field
) const
{
    const autoPtr<interpolation<Type>> scheme
    (
        interpolation<Type>::New(scheme_, field)
    );

    Field<Type> result(points_.size());
    forAll(result, i)
    {
        result[i] = scheme->interpolate(points_[i], cells_[i]);
    }

    return result;
}


Foam::vectorField Foam::schemeSampler::sample(const volVectorField& f) const
{
    return interpolate(f);
}


Foam::tensorField Foam::schemeSampler::sample(const volTensorField& f) const
{
    return interpolate(f);
}

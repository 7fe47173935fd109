#include "trilinearSampler.H"

void Foam::trilinearSampler::locate(const UList<point>& positions)
{
    sampler::locate(positions);

    values_.setSize(points_.size());
    weights_.setSize(points_.size());

    forAll(points_, i)
    {
        lattice_->stencil(points_[i], values_[i], weights_[i]);
    }
}


template<class Type>
Foam::Field<Type> Foam::trilinearSampler::interpolate
(
    const Field<Type>& cellValues
) const
{
    const List<Type> around(lattice_->gather(cellValues));
    Field<Type> result(values_.size(), Zero);

    forAll(result, i)
    {
        for (label corner = 0; corner < 8; ++corner)
        {
            result[i] += weights_[i][corner]*around[values_[i][corner]];
        }
    }

    return result;
}


Foam::vectorField Foam::trilinearSampler::sample(const volVectorField& f) const
{
    return interpolate(f.primitiveField());
}


Foam::tensorField Foam::trilinearSampler::sample(const volTensorField& f) const
{
    return interpolate(f.primitiveField());
}

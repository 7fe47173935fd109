#include "slabTransform.H"

#include <fftw3.h>

namespace
{
    constexpr unsigned planning = FFTW_ESTIMATE;

    fftw_complex* modes(double* numbers)
    {
        return reinterpret_cast<fftw_complex*>(numbers);
    }
}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::slabTransform::slabTransform
(
    const slab& cells,
    const label components,
    const label rowStride
)
:
    n_(cells.n()),
    components_(components),
    width_(2*(n_.x()/2 + 1)),
    planes_(cells, components, width_)
{
    plan(rowStride);
}


Foam::slabTransform::~slabTransform()
{
    fftw_destroy_plan(planeForward_);
    fftw_destroy_plan(planeBackward_);
    fftw_destroy_plan(columnForward_);
    fftw_destroy_plan(columnBackward_);
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::slabTransform::plan(const label rowStride)
{
    const int nModes = width_/2;

    // planes
    {
        const int n[] = {n_.y(), n_.x()};
        const int there[] = {n_.y(), n_.x()};
        const int back[] = {n_.y(), rowStride};
        const int spectrum[] = {n_.y(), nModes};
        double* plane = fftw_alloc_real(size_t(n_.y())*rowStride);
        double* modesOf = fftw_alloc_real(size_t(n_.y())*width_);

        planeForward_ = fftw_plan_many_dft_r2c
        (
            2, n, 1, plane, there, 1, 0, modes(modesOf), spectrum, 1, 0,
            planning
        );
        planeBackward_ = fftw_plan_many_dft_c2r
        (
            2, n, 1, modes(modesOf), spectrum, 1, 0, plane, back, 1, 0,
            planning
        );
        fftw_free(modesOf);
        fftw_free(plane);
    }

    // all components of a column at once
    {
        const fftw_iodim along[] = {{n_.z(), nModes, nModes}};
        const int size = n_.z()*nModes;
        const fftw_iodim many[] = {{components_, size, size}, {nModes, 1, 1}};
        double* column = fftw_alloc_real(columnSize());

        columnForward_ = fftw_plan_guru_dft
        (
            1, along, 2, many, modes(column), modes(column),
            FFTW_FORWARD, planning
        );
        columnBackward_ = fftw_plan_guru_dft
        (
            1, along, 2, many, modes(column), modes(column),
            FFTW_BACKWARD, planning
        );
        fftw_free(column);
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::slabTransform::planeForward
(
    const double* plane,
    const label z,
    const label component
)
{
    // FFTW keeps the input of such a transform, though it does not say const
    fftw_execute_dft_r2c
    (
        planeForward_,
        const_cast<double*>(plane),
        modes(planes_.plane(z, component))
    );
}


void Foam::slabTransform::columnForward(const label y, double* column)
{
    double* row = column;
    for (label c = 0; c < components_; ++c)
    for (label z = 0; z < n_.z(); ++z, row += width_)
    {
        std::copy_n(planes_.row(z, c, y), width_, row);
    }
    fftw_execute_dft(columnForward_, modes(column), modes(column));
}


void Foam::slabTransform::columnBackward(const label y, double* column)
{
    fftw_execute_dft(columnBackward_, modes(column), modes(column));
    const double* row = column;
    for (label c = 0; c < components_; ++c)
    for (label z = 0; z < n_.z(); ++z, row += width_)
    {
        std::copy_n(row, width_, planes_.row(z, c, y));
    }
}


void Foam::slabTransform::planeBackward
(
    double* plane,
    const label z,
    const label component
)
{
    fftw_execute_dft_c2r
    (
        planeBackward_, modes(planes_.plane(z, component)), plane
    );
}

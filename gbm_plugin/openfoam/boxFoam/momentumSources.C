#include "momentumSources.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::momentumSources::momentumSources(fv::optionList& options, volVectorField& U)
:
    options_(options),
    U_(U),
    others_(false)
{}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

Foam::label Foam::momentumSources::applies(fv::option& option) const
{
    const label fieldi = option.applyToField(U_.name());

    if (fieldi != -1)
    {
        option.setApplied(fieldi);
    }
    return fieldi != -1 && option.isActive() ? fieldi : -1;
}


void Foam::momentumSources::constrain()
{
    // of the equation V U/dt = ..., which an explicit step solves
    const scalarField diagonal(U_.mesh().V()/U_.time().deltaTValue());
    fvVectorMatrix equation(U_, dimVelocity/dimTime*dimVolume);
    equation.diag() = diagonal;

    forAll(options_, i)
    {
        fv::option& option = options_[i];
        const label fieldi = applies(option);

        if (fieldi == -1 || isA<explicitSource>(option))
        {
            continue;
        }
        option.constrain(equation, fieldi);

        const bool changed =
            equation.diag() != diagonal
         || equation.source() != vectorField(diagonal.size(), Zero);
        if (returnReduce(changed, orOp<bool>()))
        {
            FatalErrorInFunction
                << "fvOption '" << option.name() << "' of type "
                << option.type() << " constrains the equation of "
                << U_.name() << ": boxFoam has sources, and no matrix to"
                << " constrain" << exit(FatalError);
        }
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::momentumSources::begin(const flowStatistics& now)
{
    explicit_.clear();
    others_ = false;

    forAll(options_, i)
    {
        fv::option& option = options_[i];
        const label fieldi = applies(option);

        if (fieldi == -1)
        {
            continue;
        }
        if (explicitSource* source = dynamic_cast<explicitSource*>(&option))
        {
            source->beginRate(now);
            explicit_.append(source);
            continue;
        }

        if (!others_)
        {
            others_ = true;
            matrix_.reset
            (
                new fvVectorMatrix(U_, dimVelocity/dimTime*dimVolume)
            );
            matrix_->diag() = 0;
        }
        option.addSup(matrix_(), fieldi);
    }

    if (others_ && (matrix_->hasUpper() || matrix_->hasLower()))
    {
        FatalErrorInFunction
            << "an fvOption of " << U_.name() << " couples neighbouring"
            << " cells, which boxFoam does not do" << exit(FatalError);
    }
}


void Foam::momentumSources::add
(
    const boxVelocity& u,
    const label z,
    const latticeLayer& layer
) const
{
    for (explicitSource* source : explicit_)
    {
        source->addRate(layer);
    }
    if (!others_)
    {
        return;
    }

    const scalarField& diag = matrix_->diag();
    const vectorField& source = matrix_->source();
    const scalarField& V = U_.mesh().V();
    const label nx = layer.n.x();

    for (label y = 0; y < layer.n.y(); ++y)
    for (label x = 0; x < nx; ++x)
    {
        const label celli = u.cell(z, y, x);
        for (direction c = 0; c < 3; ++c)
        {
            layer.rate[c][x + nx*y] +=
                (
                    diag[celli]*layer.velocity[c][x + layer.stride*y]
                  - source[celli][c]
                )/V[celli];
        }
    }
}


void Foam::momentumSources::show(const modeColumn& u)
{
    for (explicitSource* source : explicit_)
    {
        source->show(u);
    }
}


void Foam::momentumSources::addModes
(
    const modeColumn& rate,
    const double factor
) const
{
    for (const explicitSource* source : explicit_)
    {
        source->addModes(rate, factor);
    }
}


void Foam::momentumSources::end()
{
    for (explicitSource* source : explicit_)
    {
        source->endRate();
    }
}


bool Foam::momentumSources::correct()
{
    if (others_)
    {
        constrain();
    }

    const label before = U_.eventNo();
    options_.correct(U_);

    return U_.eventNo() != before;
}

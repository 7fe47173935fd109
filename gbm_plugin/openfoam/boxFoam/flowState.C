#include "flowState.H"

#include <cmath>

namespace Foam
{
    defineTypeNameAndDebug(flowState, 0);
}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::flowState::flowState
(
    const fvMesh& mesh,
    const differences& D,
    boxFlow& flow,
    adamsBashforth3& scheme
)
:
    regIOobject
    (
        IOobject
        (
            "boxFoam",
            mesh.time().timeName(),
            "uniform",
            mesh,
            IOobject::READ_IF_PRESENT,
            IOobject::AUTO_WRITE
        )
    ),
    flow_(flow),
    scheme_(scheme)
{
    const Vector<label>& n = flow.cells().n();
    layout_ =
        D.name() + "-" + Foam::name(n.x()) + "x" + Foam::name(n.y()) + "x"
      + Foam::name(n.z()) + "-rank" + Foam::name(Pstream::myProcNo()) + "of"
      + Foam::name(Pstream::nProcs());
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

Foam::string Foam::flowState::take(Istream& is)
{
    const word layout(is);
    if (layout != layout_)
    {
        return "it is that of " + layout + ", and this is " + layout_;
    }

    const scalarList steps(is);
    List<double> modes(is);
    List<List<double>> rates(steps.size());
    for (List<double>& rate : rates)
    {
        is >> rate;
    }

    bool whole = is.good() && modes.size() == flow_.size();
    for (const List<double>& rate : rates)
    {
        whole = whole && rate.size() == flow_.size();
    }
    if (!whole)
    {
        return "it is not whole";
    }

    flow_.modes().transfer(modes);
    scheme_.set(rates, steps);
    return string();
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::flowState::start(volVectorField& U)
{
    forAll(U, celli)
    {
        if (!std::isfinite(mag(U[celli])))
        {
            FatalErrorInFunction
                << U.objectPath() << " is not finite in cell " << celli
                << exit(FatalError);
        }
    }

    string problem;
    bool found = typeHeaderOk<flowState>(false);

    if (returnReduce(found, andOp<bool>()))
    {
        problem = take(readStream(typeName));
        close();
        label first = problem.empty() ? labelMax : Pstream::myProcNo();
        reduce(first, minOp<label>());

        if (first == labelMax)
        {
            flow_.set(List<double>(flow_.modes()));

            // fields are written in as many digits as the case asks for
            const scalar tolerance =
                Foam::pow(10.0, 1.0 - scalar(IOstream::defaultPrecision()))
               *gMax(mag(U.primitiveField()));

            if (flow_.distance(U) <= tolerance)
            {
                Info<< "Continuing from the state in " << objectPath()
                    << nl << endl;
                flow_.store(U);
                return;
            }
            problem = "U has changed since it was written";
        }
        scheme_.set(List<List<double>>(), scalarList());
        Info<< "The state in " << objectPath() << " is left: "
            << (problem.empty() ? "another rank's does not fit" : problem.c_str())
            << endl;
    }

    const scalar left = flow_.set(U.primitiveField());
    flow_.store(U);
    Info<< "Starting from " << U.name() << ": the part that is not"
        << " divergence-free or not resolved, left out, has an rms of " << left
        << nl << endl;
}


bool Foam::flowState::writeData(Ostream& os) const
{
    os  << layout_ << nl << scheme_.steps() << nl << flow_.modes();
    for (const List<double>& rate : scheme_.rates())
    {
        os << nl << rate;
    }
    return os.good();
}


#if OPENFOAM >= 2006
bool Foam::flowState::writeObject(IOstreamOption, const bool valid) const
{
    return regIOobject::writeObject
    (
        IOstreamOption(IOstreamOption::BINARY), valid
    );
}
#else
bool Foam::flowState::writeObject
(
    IOstream::streamFormat,
    IOstream::versionNumber version,
    IOstream::compressionType,
    const bool valid
) const
{
    return regIOobject::writeObject
    (
        IOstream::BINARY, version, IOstream::UNCOMPRESSED, valid
    );
}
#endif

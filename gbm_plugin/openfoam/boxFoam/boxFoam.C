/*---------------------------------------------------------------------------*\
    gbm: long flexible fibers in OpenFOAM turbulence
    License: GPL-3.0-or-later
-------------------------------------------------------------------------------
Application
    boxFoam

Group
    grpIncompressibleSolvers

Description
    Transient solver for incompressible flow of a Newtonian fluid in a uniform,
    triply periodic box: central differences of second, fourth or sixth order
    that conserve momentum and energy, pressure and viscosity exactly by Fourier
    transforms, third order in time. See boxFlow and adamsBashforth3.

    Reads and writes U, p and phi as pimpleFoam does, with which runs can be
    continued either way; with 'writePressure no' in controlDict it writes U
    alone. All sources of U in constant/fvOptions act. Further
    state is in <time>/uniform/boxFoam, for a restart to the same bits.
\*---------------------------------------------------------------------------*/

#include "adamsBashforth3.H"
#include "besideSolver.H"
#include "feedback.H"
#include "flowState.H"
#include "kinematicViscosity.H"
#include "refusals.H"
#include "fvCFD.H"
#include "fvOptions.H"

namespace
{

//- Whether a function object may look at p or phi at any time
bool watched(const Time& runTime)
{
    const dictionary& objects =
        runTime.controlDict().subOrEmptyDict("functions");

    for (const entry& e : objects)
    {
        if
        (
            e.isDict()
         && e.dict().lookupOrDefault<word>("type", "") != "fiberCoupling"
        )
        {
            return true;
        }
    }
    return false;
}

}


int main(int argc, char *argv[])
{
    argList::addNote
    (
        "Transient solver for incompressible flow in a uniform, triply"
        " periodic box"
    );

    #include "addCheckCaseOptions.H"
    #include "setRootCaseLists.H"
    #include "createTime.H"
    #include "createMesh.H"

    refuseOthers(mesh);

    #include "createFields.H"
    #include "createTimeControls.H"

    refuseUnstable(runTime, D.stableCourant());

    state.start(U);
    const bool everyStep = watched(runTime);

    // the rate of the state at this time, and what belongs to it
    const auto evaluate = [&]()
    {
        flow.evaluate(sources);

        // long before numbers overflow
        const scalar Co = flow.largestSpeed()*runTime.deltaTValue();
        if (!std::isfinite(flow.statistics().k) || Co > 1000)
        {
            FatalErrorInFunction
                << "the flow has blown up at time " << runTime.timeName()
                << ", Courant number " << Co << ": deltaT = "
                << runTime.deltaTValue() << " is too long, the scheme is stable"
                << " up to a Courant number of " << D.stableCourant()
                << exit(FatalError);
        }
    };
    const auto complete = [&]()
    {
        if (everyStep || (writePressure && runTime.writeTime()))
        {
            Info<< "Computing p and phi" << endl;
            flow.pressure(p);
            flow.fluxes(phi);
        }
        if (everyStep || runTime.writeTime())
        {
            U.correctBoundaryConditions();
        }
    };

    // the flow has its own arrays, and U is written at once
    besideSolver::offer();

    if (feedback::wanted(runTime))
    {
        // what fibers do to the flow is a part of its rate
        runTime.functionObjects().start();
    }
    evaluate();
    complete();
    U.correctBoundaryConditions();

    Info<< "\nStarting time loop\n" << endl;

    while (runTime.run())
    {
        #include "readTimeControls.H"

        CoNum = flow.largestSpeed()*runTime.deltaTValue();
        Info<< "Courant Number mean: "
            << flow.meanSpeed()*runTime.deltaTValue()
            << " max: " << CoNum << endl;

        #include "setDeltaT.H"

        const scalar now = runTime.value();
        const label index = runTime.timeIndex();
        const scalar h = runTime.deltaTValue();

        scheme.advance
        (
            h,
            [&](const scalar fraction)
            {
                runTime.setTime(now + fraction*h, index);
                flow.store(U);
                flow.evaluate(sources);
                runTime.setTime(now, index);
            }
        );

        ++runTime;
        Info<< "Time = " << runTime.timeName() << nl << endl;

        flow.store(U);
        if (sources.correct())
        {
            flow.set(U.primitiveField());
            flow.store(U);
        }

        evaluate();
        complete();

        cumulativeContErr += flow.meanDivergence()*h;
        Info<< "time step continuity errors : sum local = "
            << flow.meanMagDivergence()*h
            << ", global = " << flow.meanDivergence()*h
            << ", cumulative = " << cumulativeContErr << endl;

        runTime.write();
        runTime.printExecutionTime(Info);
    }

    Info<< "End\n" << endl;

    return 0;
}

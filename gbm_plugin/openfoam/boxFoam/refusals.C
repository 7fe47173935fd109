#include "refusals.H"
#include "IOdictionary.H"
#include "Time.H"
#include "uniformBox.H"

namespace
{

using namespace Foam;

//- A dictionary of constant/, empty where there is none
dictionary constantDict(const fvMesh& mesh, const word& name)
{
    return IOdictionary
    (
        IOobject
        (
            name,
            mesh.time().constant(),
            mesh,
            IOobject::READ_IF_PRESENT,
            IOobject::NO_WRITE,
            false
        )
    );
}

}


void Foam::refuseOthers(const fvMesh& mesh)
{
    const uniformBox& box = uniformBox::New(mesh);
    if (!box.problem().empty())
    {
        FatalErrorInFunction
            << "boxFoam solves the flow of a uniform, triply periodic box: "
            << box.problem().c_str() << exit(FatalError);
    }

    const dictionary turbulence(constantDict(mesh, "turbulenceProperties"));
    const word type
    (
        turbulence.lookupOrDefault<word>("simulationType", "laminar")
    );
    const word model
    (
        turbulence.subOrEmptyDict("laminar").lookupOrDefault<word>
        (
            "laminarModel", "Stokes"
        )
    );
    if (type != "laminar")
    {
        FatalIOErrorInFunction(turbulence)
            << "simulationType '" << type << "': boxFoam resolves all scales,"
            << " and has no turbulence models; allowed: laminar"
            << exit(FatalIOError);
    }
    if (model != "Stokes" && model != "constantViscosity")
    {
        FatalIOErrorInFunction(turbulence)
            << "laminarModel '" << model << "': boxFoam has a constant"
            << " viscosity; allowed: constantViscosity Stokes"
            << exit(FatalIOError);
    }

    const dictionary moving(constantDict(mesh, "dynamicMeshDict"));
    const word motion
    (
        moving.lookupOrDefault<word>("dynamicFvMesh", "staticFvMesh")
    );
    if (motion != "staticFvMesh")
    {
        FatalIOErrorInFunction(moving)
            << "dynamicFvMesh '" << motion << "': boxFoam has no moving meshes"
            << exit(FatalIOError);
    }

    const dictionary zones(constantDict(mesh, "MRFProperties"));
    if (!zones.empty())
    {
        FatalIOErrorInFunction(zones)
            << "boxFoam has no rotating zones" << exit(FatalIOError);
    }
}


void Foam::refuseUnstable(const Time& time, const scalar stableCourant)
{
    const dictionary& control = time.controlDict();

    if (!control.lookupOrDefault("adjustTimeStep", false))
    {
        return;
    }
    const scalar maxCo = control.lookupOrDefault<scalar>("maxCo", 1);
    if (maxCo > stableCourant)
    {
        FatalIOErrorInFunction(control)
            << "maxCo = " << maxCo << ": the time scheme is stable up to a"
            << " Courant number of " << stableCourant << exit(FatalIOError);
    }
}

#include "fiberCloud.H"
#include "passiveParticleCloud.H"
#include "IOField.H"

void Foam::writeFiberCloud
(
    const fvMesh& mesh,
    const sampler& beads,
    const UList<fiberFamily>& families
)
{
    const word name("fibers");
    passiveParticleCloud cloud(mesh, name, IDLList<passiveParticle>());

    const auto labels = [&](const word& field)
    {
        return IOField<label>
        (
            IOobject
            (
                field,
                mesh.time().timeName(),
                cloud::prefix/name,
                mesh,
                IOobject::NO_READ,
                IOobject::NO_WRITE,
                false
            ),
            beads.indices().size()
        );
    };

    IOField<label> family(labels("family"));
    IOField<label> fiber(labels("fiber"));
    IOField<label> bead(labels("bead"));

    forAll(beads.indices(), i)
    {
        cloud.addParticle
        (
            new passiveParticle(mesh, beads.points()[i], beads.cells()[i])
        );

        label rest = beads.indices()[i];
        label f = 0;
        while (rest >= families[f].count*families[f].beads)
        {
            rest -= families[f].count*families[f].beads;
            ++f;
        }
        family[i] = f;
        fiber[i] = rest / families[f].beads;
        bead[i] = rest % families[f].beads;
    }

    cloud.write();
    family.write();
    fiber.write();
    bead.write();
}

#include "fiberCloud.H"
#include "passiveParticleCloud.H"
#include "IOField.H"

void Foam::writeFiberCloud
(
    const fvMesh& mesh,
    const beadExchange& beads,
    const List<List<fiberFamily>>& families
)
{
    const word name("fibers");
    // passiveParticleCloud itself has no such constructor in later versions
    Cloud<passiveParticle> cloud(mesh, name, IDLList<passiveParticle>());

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
            beads.points().size()
        );
    };

    IOField<label> family(labels("family"));
    IOField<label> fiber(labels("fiber"));
    IOField<label> bead(labels("bead"));

    // fibers are counted over all families, as in the series of 'gbm report'
    labelList firstOf;
    for (const List<fiberFamily>& rank : families)
    {
        for (const fiberFamily& part : rank)
        {
            if (firstOf.size() < part.family + 2)
            {
                firstOf.resize(part.family + 2, 0);
            }
            firstOf[part.family + 1] += part.count;
        }
    }
    for (label f = 1; f < firstOf.size(); ++f)
    {
        firstOf[f] += firstOf[f - 1];
    }

    forAll(beads.points(), i)
    {
        cloud.addParticle
        (
            new passiveParticle(mesh, beads.points()[i], beads.cells()[i])
        );

        label rest = beads.numberOf(i);
        const fiberFamily* part = families[beads.rankOf(i)].cdata();
        while (rest >= part->size())
        {
            rest -= part->size();
            ++part;
        }
        family[i] = part->family;
        fiber[i] = firstOf[part->family] + part->first + rest/part->beads;
        bead[i] = rest % part->beads;
    }

    cloud.write();
    family.write();
    fiber.write();
    bead.write();
}

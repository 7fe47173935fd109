#include "fiberFamily.H"
#include "Pair.H"

#include <cstdio>
#include <fstream>

namespace
{

using namespace Foam;

//- Fibers and beads of each in an array (fibers, beads, 3) of NumPy's .npy
//  format, whose header says it in words: {..., 'shape': (60, 20, 3), }
Pair<label> sizeOf(const dictionary& family, const fileName& path)
{
    std::ifstream is(path, std::ios::binary);
    std::string header(512, '\0');
    is.read(&header[0], header.size());

    int count = 0, beads = 0, end = 0;
    const std::size_t start = header.find("'shape': (");
    if
    (
        start != std::string::npos
     && std::sscanf
        (
            header.c_str() + start, "'shape': (%d, %d, 3)%n",
            &count, &beads, &end
        ) == 2
     && end
    )
    {
        return Pair<label>(count, beads);
    }

    FatalIOErrorInFunction(family)
        << "positions " << path << " is not an array (fibers, beads, 3) that"
        << " numpy.save has written" << exit(FatalIOError);
    return Pair<label>();
}

}


Foam::List<Foam::fiberFamily> Foam::readFamilies
(
    const dictionary& fiberProperties,
    const fileName& caseFolder,
    const daemonShare& share
)
{
    List<fiberFamily> families;

    for (const entry& e : fiberProperties.subDict("families"))
    {
        const dictionary& family = e.dict();
        const Pair<label> size
        (
            family.lookupOrDefault<word>("shape", "straight") == "file"
          ? sizeOf(family, caseFolder/family.get<fileName>("positions"))
          : Pair<label>(family.get<label>("count"), family.get<label>("beads"))
        );

        const std::int64_t all = size.first();
        const label first = (all*(share.number - 1))/share.of;
        const label count = (all*share.number)/share.of - first;
        const label beads = size.second();

        // all that a bead is sampled for has a number
        if (count < 1 || beads < 1 || count > labelMax/12/beads)
        {
            FatalIOErrorInFunction(family)
                << count << " fibers of " << beads << " beads for a daemon:"
                << " from 1 to " << labelMax/12 << " beads are possible"
                << exit(FatalIOError);
        }
        families.append({families.size(), count, beads, first});
    }

    return families;
}

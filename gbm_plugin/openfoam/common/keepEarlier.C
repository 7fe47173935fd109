#include "keepEarlier.H"
#include "OSspecific.H"

void Foam::keepEarlier(const fileName& path)
{
    if (!isFile(path, false))
    {
        return;
    }

    label number = 1;
    while (isFile(path + "." + std::to_string(number), false))
    {
        ++number;
    }
    mv(path, path + "." + std::to_string(number));
}

#include "allowedEntries.H"
#include "FlatOutput.H"

void Foam::allowedEntries(const dictionary& dict, const wordList& allowed)
{
    for (const entry& e : dict)
    {
        if (!e.keyword().isPattern() && !allowed.found(e.keyword()))
        {
            FatalIOErrorInFunction(dict)
                << "unknown entry '" << e.keyword() << "' in " << dict.name()
                << "; allowed: " << flatOutput(allowed)
                << exit(FatalIOError);
        }
    }
}

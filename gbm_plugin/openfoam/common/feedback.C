#include "feedback.H"
#include "IOdictionary.H"

bool Foam::feedback::wanted(const Time& time)
{
    const IOdictionary fiberProperties
    (
        IOobject
        (
            "fiberProperties",
            time.constant(),
            time,
            IOobject::READ_IF_PRESENT,
            IOobject::NO_WRITE,
            false
        )
    );

    return
        fiberProperties.subOrEmptyDict("coupling")
       .lookupOrDefault<Switch>("feedback", false);
}


std::shared_ptr<Foam::scalar> Foam::feedback::exchange()
{
    static const std::shared_ptr<scalar> shared(new scalar(0));

    return shared;
}

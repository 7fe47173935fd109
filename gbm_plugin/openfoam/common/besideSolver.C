#include "besideSolver.H"
#include "error.H"

#include <chrono>
#include <csignal>
#include <future>
#include <stdexcept>

namespace
{

bool isOffered = false;
std::future<void> atWork;
Foam::besideSolver::conclusion atEnd;
thread_local bool working = false;

//- Room for the solver's next field; or what work reads, once that has come
Foam::vectorField spare;
bool replaced = false;


//- While one exists, signals are for other threads than those that it starts,
//  and so for the solver, as without them
class signalsElsewhere
{
    sigset_t before_;

public:

    signalsElsewhere()
    {
        sigset_t all;
        sigfillset(&all);
        for (const int own : {SIGFPE, SIGSEGV, SIGBUS, SIGILL, SIGABRT})
        {
            sigdelset(&all, own);
        }
        pthread_sigmask(SIG_SETMASK, &all, &before_);
    }

    ~signalsElsewhere()
    {
        pthread_sigmask(SIG_SETMASK, &before_, nullptr);
    }
};

}


void Foam::besideSolver::offer()
{
    isOffered = true;
}


bool Foam::besideSolver::offered()
{
    return isOffered;
}


void Foam::besideSolver::replace(vectorField& field)
{
    if (!atWork.valid() || replaced)
    {
        return;
    }
    replaced = true;

    // the numbers stay where they are, under another name
    vectorField before;
    before.transfer(field);
    spare.setSize(before.size());
    field.transfer(spare);
    spare.transfer(before);
}


void Foam::besideSolver::start
(
    const std::function<void()>& work,
    const conclusion& conclude
)
{
    finish();

    atEnd = conclude;
    replaced = false;

    const signalsElsewhere guard;
    atWork = std::async
    (
        std::launch::async,
        [work]()
        {
            working = true;
            work();
        }
    );
}


void Foam::besideSolver::finish()
{
    if (!atWork.valid())
    {
        return;
    }

    const auto start = std::chrono::steady_clock::now();
    atWork.wait();
    const std::chrono::duration<scalar> waited
    (
        std::chrono::steady_clock::now() - start
    );

    try
    {
        atWork.get();
    }
    catch (const std::exception& e)
    {
        fail(e.what());
    }
    atEnd(waited.count());
}


void Foam::besideSolver::fail(const std::string& what)
{
    if (working)
    {
        // OpenFOAM's own errors, one for all threads, are the solver's
        throw std::runtime_error(what);
    }
    FatalErrorInFunction << what.c_str() << exit(FatalError);

    ::abort();
}

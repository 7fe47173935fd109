#include "nodeMemory.H"
#include "debug.H"
#include "Pstream.H"
#include "registerSwitch.H"

#include <fftw3.h>
#include <sys/statvfs.h>

namespace
{
    //- FFTW's vectors need it, and MPI gives windows that are not
    constexpr size_t alignment = 64;

    double* aligned(double* numbers)
    {
        const size_t past = reinterpret_cast<size_t>(numbers) % alignment;
        return numbers + (past ? (alignment - past)/sizeof(double) : 0);
    }
}


int Foam::nodeMemory::share
(
    Foam::debug::optimisationSwitch("nodeMemory", 1)
);
registerOptSwitch("nodeMemory", int, Foam::nodeMemory::share);


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::nodeMemory::nodeMemory(const size_t size)
:
    node_(MPI_COMM_NULL),
    window_(MPI_WIN_NULL),
    numbers_(Pstream::nProcs(), nullptr)
{
    const label me = Pstream::myProcNo();

    if (Pstream::parRun())
    {
        MPI_Comm_split_type
        (
            MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, me, MPI_INFO_NULL, &node_
        );
    }
    if (!affordable(size*sizeof(double)))
    {
        numbers_[me] = fftw_alloc_real(size);
        return;
    }

    // each rank's numbers on pages of their own, near to it
    MPI_Info apart;
    MPI_Info_create(&apart);
    MPI_Info_set(apart, "alloc_shared_noncontig", "true");
    MPI_Win_allocate_shared
    (
        size*sizeof(double) + alignment, sizeof(double), apart, node_,
        &numbers_[me], &window_
    );
    MPI_Info_free(&apart);
    MPI_Win_lock_all(MPI_MODE_NOCHECK, window_);

    int nNode;
    MPI_Comm_size(node_, &nNode);
    List<int> ranks(nNode);
    MPI_Allgather(&me, 1, MPI_INT, ranks.begin(), 1, MPI_INT, node_);
    forAll(ranks, i)
    {
        MPI_Aint bytes;
        int unit;
        double* numbers;
        MPI_Win_shared_query(window_, i, &bytes, &unit, &numbers);
        numbers_[ranks[i]] = aligned(numbers);
    }
}


Foam::nodeMemory::~nodeMemory()
{
    if (window_ == MPI_WIN_NULL)
    {
        fftw_free(numbers_[Pstream::myProcNo()]);
    }
    else
    {
        MPI_Win_unlock_all(window_);
        MPI_Win_free(&window_);
    }
    if (node_ != MPI_COMM_NULL)
    {
        MPI_Comm_free(&node_);
    }
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

bool Foam::nodeMemory::affordable(const size_t bytes) const
{
    int nNode = 1;
    if (node_ != MPI_COMM_NULL)
    {
        MPI_Comm_size(node_, &nNode);
    }
    if (nNode == 1)
    {
        return false;
    }

    // MPI may wait for ever, or be killed, where its window does not fit
    double wanted = bytes, sum = 0;
    MPI_Allreduce(&wanted, &sum, 1, MPI_DOUBLE, MPI_SUM, node_);
    struct statvfs room;
    int fits =
        share
     && (
            statvfs("/dev/shm", &room) != 0
         || 1.1*sum < double(room.f_bavail)*room.f_frsize
        );
    MPI_Allreduce(MPI_IN_PLACE, &fits, 1, MPI_INT, MPI_LAND, node_);

    return fits;
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::nodeMemory::meet() const
{
    if (window_ != MPI_WIN_NULL)
    {
        MPI_Win_sync(window_);
        MPI_Barrier(node_);
        MPI_Win_sync(window_);
    }
}

#include "lattice.H"
#include "globalIndex.H"
#include "mapDistribute.H"

// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

Foam::labelList Foam::lattice::globalCells
(
    const globalIndex& cells,
    const labelUList& numbers
) const
{
    // A directory spread over the ranks: rank r keeps the numbers of its
    // equal share. Every cell reports there; then the directory is read.
    const Vector<label>& n = box_.cells();
    const label total = n.x()*n.y()*n.z();
    const label share = (total + Pstream::nProcs() - 1)/Pstream::nProcs();
    const label mine =
        max(label(0), min(share, total - share*Pstream::myProcNo()));
    const globalIndex directory(mine);

    List<DynamicList<labelPair>> reports(Pstream::nProcs());
    for (label celli = 0; celli < mesh_.nCells(); ++celli)
    {
        const label i = box_.number(box_.place(celli));
        reports[i/share].append(labelPair(i % share, cells.toGlobal(celli)));
    }

    PstreamBuffers buffers(Pstream::commsTypes::nonBlocking);
    forAll(reports, rank)
    {
        UOPstream to(rank, buffers);
        to << reports[rank];
    }
    buffers.finishedSends();

    labelList entries(mine, -1);
    forAll(reports, rank)
    {
        UIPstream from(rank, buffers);
        const List<labelPair> pairs(from);
        for (const labelPair& pair : pairs)
        {
            entries[pair.first()] = pair.second();
        }
    }

    // share*rank + offset is the directory's own global numbering, as all
    // shares before the last one are full
    labelList wanted(numbers);
    List<Map<label>> compact;
    const mapDistribute map(directory, wanted, compact);
    map.distribute(entries);

    return labelList(UIndirectList<label>(entries, wanted));
}


void Foam::lattice::connect
(
    const labelUList& remoteSlots,
    const labelUList& numbers
)
{
    const globalIndex cells(mesh_.nCells());
    const labelList remote(globalCells(cells, numbers));

    labelListList asked(Pstream::nProcs());
    {
        List<DynamicList<label>> asking(Pstream::nProcs());
        List<DynamicList<label>> slots(Pstream::nProcs());

        forAll(remote, i)
        {
            const label rank = cells.whichProcID(remote[i]);
            asking[rank].append(cells.toLocal(rank, remote[i]));
            slots[rank].append(remoteSlots[i]);
        }

        // values come rank by rank, after those of the local cells
        label value = mesh_.nCells();
        received_.setSize(Pstream::nProcs(), 0);
        forAll(asking, rank)
        {
            asked[rank].transfer(asking[rank]);
            received_[rank] = asked[rank].size();
            for (const label s : slots[rank])
            {
                slots_[s] = value++;
            }
        }
    }

    sent_.setSize(Pstream::nProcs());
    PstreamBuffers buffers(Pstream::commsTypes::nonBlocking);
    forAll(asked, rank)
    {
        UOPstream to(rank, buffers);
        to << asked[rank];
    }
    buffers.finishedSends();
    forAll(sent_, rank)
    {
        UIPstream from(rank, buffers);
        from >> sent_[rank];
    }
}


void Foam::lattice::measureRuns()
{
    const label nCells = mesh_.nCells();
    const auto local = [&](const label s)
    {
        return slots_[s] >= 0 && slots_[s] < nCells;
    };

    runs_.setSize(slots_.size());
    for (label s = slots_.size() - 1; s >= 0; --s)
    {
        const bool follows =
            local(s) && s + 1 < slots_.size()
         && local(s + 1) && slots_[s + 1] == slots_[s] + 1;

        runs_[s] = follows ? min(runs_[s + 1] + 1, 255) : local(s);
    }
}


void Foam::lattice::divide()
{
    Pstream::gatherList(blocks_);
    Pstream::scatterList(blocks_);

    // 16 blocks in each direction, or cells where there are fewer
    const Vector<label>& n = box_.cells();
    for (direction d = 0; d < vector::nComponents; ++d)
    {
        coarse_[d] = (n[d] + 15)/16;
        nCoarse_[d] = (n[d] + coarse_[d] - 1)/coarse_[d];
    }

    List<DynamicList<label>> ranks(nCoarse_.x()*nCoarse_.y()*nCoarse_.z());
    forAll(blocks_, rank)
    {
        const Vector<label> first(coarsePlace(blocks_[rank].first()));
        const Vector<label> last(coarsePlace(blocks_[rank].second()));

        if (cmptMin(blocks_[rank].second()) < 0)
        {
            continue;       // a rank without cells
        }
        for (label k = first.z(); k <= last.z(); ++k)
        for (label j = first.y(); j <= last.y(); ++j)
        for (label i = first.x(); i <= last.x(); ++i)
        {
            ranks[i + nCoarse_.x()*(j + nCoarse_.y()*k)].append(rank);
        }
    }

    ranks_.setSize(ranks.size());
    forAll(ranks, i)
    {
        ranks_[i].transfer(ranks[i]);
    }
}

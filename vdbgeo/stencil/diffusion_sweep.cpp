#include "vdbgeo/stencil/diffusion_sweep.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <thread>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/stencil/plane_kernels.h"
#include "vdbgeo/stencil/tile_gather.h"

namespace vdbgeo::stencil {
namespace {

constexpr int run_length =
    4;  // cells: longer runs save halo along x, shorter ones spread better over threads

/// Planes of a tile, the last few along x, each at x modulo their number. Rows lie on cache lines.
class PlaneRing {
 public:
    PlaneRing(int planes, std::ptrdiff_t plane_size, float fill)
        : planes_(planes),
          size_(plane_size),
          data_((static_cast<std::size_t>(planes * plane_size) + 2 * guard) / BlockField::brick_size + 1) {
        std::fill_n(data_.brick(0), data_.bricks() * BlockField::brick_size, fill);
    }
    float* at(int x) { return data_.brick(0) + guard + ((x % planes_ + planes_) % planes_) * size_; }
    Planes around(int x) { return {at(x - 1), at(x), at(x + 1)}; }

 private:
    static constexpr std::size_t guard = 2 * lanes;  // a row's neighbours along z are read beyond the ends
    int planes_;
    std::ptrdiff_t size_;
    BlockField data_;
};

/// The arrays one thread works in.
struct Scratch {
    struct Field {
        std::vector<PlaneRing> u;         // two: u_k and u_{k±1}
        std::vector<PlaneRing> powers;    // L^j u, j = 1…
        std::vector<PlaneRing> d;         // by term; those without a diffusivity have none
        std::vector<PlaneRing> target;    // one where it is a field of its own
        std::vector<PlaneRing> gathered;  // one plane, where there are several orders
    };
    std::vector<Field> fields;
    std::vector<PlaneRing> activity;  // one where a term has no diffusivity
    std::vector<RowSpan> spans;       // ring of planes
    int first_row = 0, last_row = 0;  // rows [first, last) are there, with their halo
};

class Sweep {
 public:
    Sweep(const BlockLayout& layout, SweepPlan& plan) : layout_(layout), plan_(plan), kernels_(kernels()) {
        for (const SweepField& f : plan.fields) top_ = std::max(top_, f.terms.back().order);
        halo_ = static_cast<int>(plan.steps.size()) * (top_ + 1);
        if (halo_ > BlockLayout::max_halo) throw InvalidInput("the order is too high for the halo of a tile");
        planes_ = halo_ + 4;
        stride_ = TileGather::stride_of(halo_);
        rows_ = TileGather::rows_of(halo_);
    }

    void run(BlockLayout::Run cells, Scratch& s) const;
    Scratch make_scratch() const;

 private:
    void gather(TileGather& tile, int x, Scratch& s) const;
    void advance(int k, int lead, int x_first, Scratch& s) const;
    void step(int k, int x, int margin, std::size_t field, Scratch& s) const;
    void scatter(TileGather& tile, int x, Scratch& s) const;
    PlaneRange range(int x, int margin, Scratch& s) const {
        return {s.first_row + margin, s.last_row - margin, stride_,
                spans(x, s),          spans(x - 1, s),     spans(x + 1, s)};
    }
    RowSpan* spans(int x, Scratch& s) const {
        return s.spans.data() + ((x % planes_ + planes_) % planes_) * rows_;
    }
    /// What tells active voxels from others.
    PlaneRing& mask(Scratch& s, std::size_t field) const {
        return s.activity.empty() ? s.fields[field].d.front() : s.activity.front();
    }

    const BlockLayout& layout_;
    SweepPlan& plan_;
    const Kernels& kernels_;
    int top_ = 0, halo_ = 0, planes_ = 0, rows_ = 0;
    std::ptrdiff_t stride_ = 0;
};

Scratch Sweep::make_scratch() const {
    Scratch s;
    const std::ptrdiff_t size = rows_ * stride_;
    for (const SweepField& f : plan_.fields) {
        Scratch::Field out;
        for (int i = 0; i < 2; ++i) out.u.emplace_back(planes_, size, 0.0f);
        for (int i = 0; i < f.terms.back().order; ++i) out.powers.emplace_back(planes_, size, 0.0f);
        for (const SweepTerm& t : f.terms) {
            if (t.diffusivity)
                out.d.emplace_back(planes_, size, inactive);
            else if (s.activity.empty())
                s.activity.emplace_back(planes_, size, inactive);
        }
        if (f.target) out.target.emplace_back(planes_, size, 0.0f);
        if (f.terms.size() > 1) out.gathered.emplace_back(1, size, 0.0f);
        s.fields.push_back(std::move(out));
    }
    s.spans.assign(static_cast<std::size_t>(planes_ * rows_), RowSpan{0, 0});
    return s;
}

void Sweep::gather(TileGather& tile, int x, Scratch& s) const {
    for (std::size_t i = 0; i < plan_.fields.size(); ++i) {
        const SweepField& f = plan_.fields[i];
        Scratch::Field& to = s.fields[i];
        // Where there is no leaf, no face is open: any finite value will do, such as what was there before.
        const ShiftedField &now = *f.state, &before = plan_.begins ? now : *f.before;
        tile.copy(now.now(), {}, to.u[0].at(x));
        tile.copy(before.now(), {}, to.u[1].at(x));
        std::size_t d = 0;
        for (const SweepTerm& t : f.terms)
            if (t.diffusivity) tile.copy(t.diffusivity, inactive, to.d[d++].at(x));
        if (f.target) tile.copy(f.target, {}, to.target.front().at(x));
    }
    if (!s.activity.empty()) tile.activity(1, inactive, s.activity.front().at(x));
    tile.spans(spans(x, s));
}

void Sweep::step(int k, int x, int margin, std::size_t field, Scratch& s) const {
    const SweepField& f = plan_.fields[field];
    Scratch::Field& at = s.fields[field];
    const SweepPlan::Step& now = plan_.steps[static_cast<std::size_t>(k)];
    const PlaneRange where = range(x, margin, s);
    const auto here = static_cast<std::size_t>(k & 1);
    std::size_t d = 0;
    for (std::size_t t = 0; t < f.terms.size(); ++t) {
        const SweepTerm& term = f.terms[t];
        const Planes w = term.order == 0 ? at.u[here].around(x)
                                         : at.powers[static_cast<std::size_t>(term.order - 1)].around(x);
        const Planes c = term.diffusivity ? at.d[d++].around(x) : s.activity.front().around(x);
        float weight[3];
        for (int a = 0; a < 3; ++a)
            weight[a] = static_cast<float>(0.5 * now.relaxation * now.tau * term.factor * plan_.weights[a]);
        if (t + 1 < f.terms.size()) {
            kernels_.flux(where, w, c, weight, t > 0, at.gathered.front().at(0));
            continue;
        }
        StepPlane p{};
        p.w = w;
        p.d = c;
        p.here = at.u[here].at(x);
        p.next = at.u[1 - here].at(x);
        p.gathered = t > 0 ? at.gathered.front().at(0) : nullptr;
        if (f.coupling != 0)
            p.target = f.target ? at.target.front().at(x) : s.fields[1 - field].u[here].at(x);
        std::copy(weight, weight + 3, p.weight);
        p.relaxation = static_cast<float>(now.relaxation);
        p.fidelity = static_cast<float>(now.relaxation * now.tau * f.coupling);
        kernels_.step(where, p);
    }
}

void Sweep::advance(int k, int lead, int x_first, Scratch& s) const {
    const float weight[3] = {static_cast<float>(plan_.weights[0]), static_cast<float>(plan_.weights[1]),
                             static_cast<float>(plan_.weights[2])};
    const int done = k * (top_ + 1);  // planes and rows that earlier steps made invalid
    for (std::size_t i = 0; i < plan_.fields.size(); ++i) {
        Scratch::Field& f = s.fields[i];
        for (int j = 1; j <= plan_.fields[i].terms.back().order; ++j) {
            const int x = lead - j, margin = done + j;
            if (x < x_first + margin) break;
            PlaneRing& from =
                j == 1 ? f.u[static_cast<std::size_t>(k & 1)] : f.powers[static_cast<std::size_t>(j - 2)];
            kernels_.laplacian(range(x, margin, s), from.around(x), mask(s, i).around(x), weight,
                               f.powers[static_cast<std::size_t>(j - 1)].at(x));
        }
    }
    const int x = lead - top_ - 1, margin = done + top_ + 1;
    if (x < x_first + margin) return;
    for (std::size_t i = 0; i < plan_.fields.size(); ++i) step(k, x, margin, i, s);
}

void Sweep::scatter(TileGather& tile, int x, Scratch& s) const {
    tile.move_to(x);
    const std::size_t last = plan_.steps.size() & 1;
    for (std::size_t i = 0; i < plan_.fields.size(); ++i) {
        tile.scatter(s.fields[i].u[last].at(x), plan_.fields[i].state->next());
        if (!plan_.ends) tile.scatter(s.fields[i].u[1 - last].at(x), plan_.fields[i].before->next());
    }
}

void Sweep::run(BlockLayout::Run cells, Scratch& s) const {
    TileGather in(layout_, cells, halo_), out(layout_, cells, halo_);
    const int first = in.x_begin() - halo_;
    s.first_row = in.y_begin();
    s.last_row = in.y_end() + 2 * halo_;
    for (int x = first; x < in.x_end() + halo_; ++x) {
        in.move_to(x);
        gather(in, x, s);
        for (int k = 0; k < static_cast<int>(plan_.steps.size()); ++k)
            advance(k, x - k * (top_ + 1), first, s);
        if (x - halo_ >= in.x_begin()) scatter(out, x - halo_, s);
    }
    kernels_.finish_writing();
}

}  // namespace

ShiftedField::ShiftedField(const BlockLayout& layout) {
    std::size_t previous = 0;
    for (const BlockLayout::Slab& slab : layout.slabs()) {
        const std::size_t size = slab.end - slab.begin;
        shift_ = std::max(shift_, previous + size);
        previous = size;
    }
    field_ = BlockField(layout.brick_count() + shift_);
}

int sweep_halo(int max_order) { return steps_per_sweep(max_order) * (max_order + 1); }

int steps_per_sweep(int max_order) {
    switch (max_order) {
        case 0:
            return 8;
        case 1:
            return 4;
        case 2:
            return 2;
        case 3:
            return 2;
        default:
            return 1;
    }
}

void sweep(const BlockLayout& layout, SweepPlan& plan, const Progress& progress) {
    const Sweep work(layout, plan);
    tbb::enumerable_thread_specific<Scratch> scratch([&] { return work.make_scratch(); });
    const auto& slabs = layout.slabs();
    const bool forward = plan.fields.front().state->forward();
    const std::thread::id caller = std::this_thread::get_id();
    for (std::size_t i = 0; i < slabs.size(); ++i) {
        const std::size_t at = forward ? i : slabs.size() - 1 - i;
        const std::vector<BlockLayout::Run> runs = layout.runs(slabs[at], run_length);
        if (plan.before_slab) plan.before_slab(at);
        parallel_for(runs.size(), 1, [&](std::size_t r) {
            work.run(runs[r], scratch.local());
            if (plan.meanwhile && std::this_thread::get_id() == caller) plan.meanwhile();
        });
        if (plan.after_slab) plan.after_slab(at);
        progress.report(static_cast<double>(i + 1) / static_cast<double>(slabs.size()));
    }
    for (SweepField& f : plan.fields) {
        f.state->turn();
        if (f.before) f.before->turn();
    }
}

}  // namespace vdbgeo::stencil

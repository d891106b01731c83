#include "vdbgeo/tet/netgen_tetrahedra.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <exception>
#include <new>

#include "vdbgeo/core/errors.h"
#include "vdbgeo/core/parallel.h"
#include "vdbgeo/tet/filled_mesh.h"
#include "vdbgeo/tet/isolated.h"
#include "vdbgeo/tet/solid_input.h"

#ifdef VDBGEO_HAS_NETGEN
namespace nglib {
#include <nglib.h>
}
#endif

namespace vdbgeo {
namespace {

constexpr const char* stage = "netgen";

}  // namespace

void NetgenOptions::check() const {
    if (max_edge_A && !(*max_edge_A > 0 && std::isfinite(*max_edge_A)))
        throw InvalidInput(
            fmt::format("{}: the longest edge is {} Å, where more than 0 is needed", stage, *max_edge_A));
    if (!(grading >= 0 && grading <= 1))
        throw InvalidInput(fmt::format("{}: the grading is {}, where 0 to 1 is needed", stage, grading));
    if (optimisation_rounds < 0 || optimisation_rounds > 20)
        throw InvalidInput(fmt::format("{}: {} rounds of optimisation, where 0 to 20 are allowed", stage,
                                       optimisation_rounds));
    if (max_tets == 0) throw InvalidInput("netgen: no tetrahedra are allowed");
    if (!(max_seconds > 0))
        throw InvalidInput(fmt::format("netgen: {} s are allowed, where more than 0 is needed", max_seconds));
}

#ifndef VDBGEO_HAS_NETGEN

bool have_netgen() { return false; }

TetMesh netgen_tetrahedra(const TriMesh&, const NetgenOptions&, const Progress&) {
    throw InvalidInput("netgen: this build has no NetGen");
}

#else

namespace {

constexpr VertexId none = 0xFFFFFFFFu;

/// NetGen's library, loaded when it is first needed: linked, it would bring a hundred libraries (OpenCASCADE,
/// MPI, Python) and 40 MB into every run of every program. Names are as the Itanium C++ ABI mangles them.
class Nglib {
 public:
    static const Nglib& get() {
        static const Nglib library;
        return library;
    }

    decltype(&nglib::Ng_Init) init;
    decltype(&nglib::Ng_NewMesh) new_mesh;
    decltype(&nglib::Ng_AddPoint) add_point;
    decltype(&nglib::Ng_AddSurfaceElement) add_surface_element;
    decltype(&nglib::Ng_GenerateVolumeMesh) generate_volume_mesh;
    decltype(&nglib::Ng_GetNP) points;
    decltype(&nglib::Ng_GetNE) elements;
    decltype(&nglib::Ng_GetPoint) point;
    decltype(&nglib::Ng_GetVolumeElement) volume_element;
    void (*make_parameters)(void*);  ///< the constructor of Ng_Meshing_Parameters

 private:
    Nglib() : library_(dlopen(VDBGEO_NGLIB_FILE, RTLD_NOW | RTLD_LOCAL)) {
        if (!library_) throw InvalidInput(fmt::format("netgen: its library cannot be loaded: {}", dlerror()));
        find("_ZN5nglib7Ng_InitEv", init);
        find("_ZN5nglib10Ng_NewMeshEv", new_mesh);
        find("_ZN5nglib11Ng_AddPointEPPvPd", add_point);
        find("_ZN5nglib20Ng_AddSurfaceElementEPPvNS_23Ng_Surface_Element_TypeEPi", add_surface_element);
        find("_ZN5nglib21Ng_GenerateVolumeMeshEPPvPNS_21Ng_Meshing_ParametersE", generate_volume_mesh);
        find("_ZN5nglib8Ng_GetNPEPPv", points);
        find("_ZN5nglib8Ng_GetNEEPPv", elements);
        find("_ZN5nglib11Ng_GetPointEPPviPd", point);
        find("_ZN5nglib19Ng_GetVolumeElementEPPviPi", volume_element);
        find("_ZN5nglib21Ng_Meshing_ParametersC1Ev", make_parameters);
    }

    template <class Function>
    void find(const char* name, Function& function) {
        function = reinterpret_cast<Function>(dlsym(library_, name));
        if (!function) throw InvalidInput(fmt::format("netgen: its library has no {}", name));
    }

    void* library_;
};

/// The surface of one solid: shell and cavities, turned outward of it.
struct SolidSurface {
    std::vector<VertexId> points;  ///< of the whole surface, ascending
    Array<Triangle> triangles;     ///< by places in `points`
};

std::vector<SolidSurface> part(const SolidInput& input) {
    std::vector<SolidSurface> solids(input.regions.size());
    for (std::size_t f = 0; f < input.triangles.size(); ++f) {
        const Triangle& t = input.triangles[f];
        for (const std::size_t side : {0u, 1u}) {
            const std::int32_t s = input.solids[f][side];
            if (s == SolidInput::outside) continue;
            solids[static_cast<std::size_t>(s)].triangles.push_back(side == 0 ? t
                                                                              : Triangle{t[0], t[2], t[1]});
        }
    }
    std::vector<VertexId> number(input.points.size(), none);
    for (SolidSurface& solid : solids) {
        for (const Triangle& t : solid.triangles)
            for (const VertexId v : t) {
                if (number[v] == none) solid.points.push_back(v);
                number[v] = 0;
            }
        std::sort(solid.points.begin(), solid.points.end());
        for (std::size_t i = 0; i < solid.points.size(); ++i)
            number[solid.points[i]] = static_cast<VertexId>(i);
        for (Triangle& t : solid.triangles)
            for (VertexId& v : t) v = number[v];
        for (const VertexId v : solid.points) number[v] = none;
    }
    return solids;
}

double longest_extent(const SolidInput& input, const SolidSurface& solid) {
    Eigen::AlignedBox3d box;
    for (const VertexId v : solid.points) box.extend(input.points[v]);
    return box.diagonal().norm();
}

nglib::Ng_Mesh* surface_of(const SolidInput& input, const SolidSurface& solid) {
    const Nglib& library = Nglib::get();
    library.init();
    nglib::Ng_Mesh* mesh = library.new_mesh();
    for (const VertexId v : solid.points) {
        Vec3d p = input.points[v];
        library.add_point(mesh, p.data());
    }
    for (const Triangle& t : solid.triangles) {
        int corners[3];
        for (std::size_t k = 0; k < 3; ++k) corners[k] = static_cast<int>(t[k]) + 1;
        library.add_surface_element(mesh, nglib::NG_TRIG, corners);
    }
    return mesh;
}

void generate(nglib::Ng_Mesh* mesh, const NetgenOptions& options, double extent) {
    const Nglib& library = Nglib::get();
    alignas(nglib::Ng_Meshing_Parameters) std::byte memory[sizeof(nglib::Ng_Meshing_Parameters)];
    library.make_parameters(memory);
    auto& parameters = *std::launder(reinterpret_cast<nglib::Ng_Meshing_Parameters*>(memory));
    parameters.maxh = options.max_edge_A.value_or(extent);
    parameters.grading = options.grading;
    parameters.optsteps_3d = options.optimisation_rounds;
    parameters.optvolmeshenable = options.optimisation_rounds > 0;
    parameters.check_overlap = 0;
    parameters.check_overlapping_boundary = 0;
    const nglib::Ng_Result result = library.generate_volume_mesh(mesh, &parameters);
    if (result == nglib::NG_SURFACE_INPUT_ERROR)
        throw InvalidInput("it does not take this surface; try repair");
    if (result != nglib::NG_OK)
        throw NumericalError(
            fmt::format("it could not fill the surface (code {}); try remesh first, or another "
                        "method",
                        int(result)));
}

/// In a process of its own: points of the solid's surface first.
std::vector<std::byte> run_netgen(const SolidInput& input, const SolidSurface& solid, std::size_t place,
                                  const NetgenOptions& options) {
    nglib::Ng_Mesh* mesh = surface_of(input, solid);
    generate(mesh, options, longest_extent(input, solid));
    const Nglib& library = Nglib::get();
    Filling filling;
    filling.points.resize(static_cast<std::size_t>(library.points(mesh)));
    for (std::size_t i = 0; i < filling.points.size(); ++i)
        library.point(mesh, static_cast<int>(i) + 1, filling.points[i].data());
    const auto tets = static_cast<std::size_t>(library.elements(mesh));
    if (tets > options.max_tets)
        throw NumericalError(fmt::format("more than {} tetrahedra, the limit", options.max_tets));
    for (std::size_t t = 0; t < tets; ++t) {
        int c[NG_VOLUME_ELEMENT_MAXPOINTS];
        library.volume_element(mesh, static_cast<int>(t) + 1, c);
        // NetGen's corners run the other way round.
        filling.tets.push_back(
            {VertexId(c[1] - 1), VertexId(c[0] - 1), VertexId(c[2] - 1), VertexId(c[3] - 1)});
        filling.solid.push_back(static_cast<std::int32_t>(place));
    }
    return to_bytes(filling);
}

/// Puts the filling of a solid behind those before it; its surface's points are there already.
void append(const Filling& filling, const SolidInput& input, const SolidSurface& solid, Filling& all) {
    const std::size_t on_surface = solid.points.size();
    if (filling.points.size() < on_surface) throw NumericalError("netgen: points of the surface are missing");
    for (std::size_t i = 0; i < on_surface; ++i)
        if (filling.points[i] != input.points[solid.points[i]])
            throw NumericalError("netgen: it did not keep the points of the surface");
    const std::size_t shift = all.points.size() - on_surface;
    if (shift + filling.points.size() > TriMesh::max_vertices)
        throw NumericalError("netgen: more than 2^32-1 points");
    all.points.insert(all.points.end(), filling.points.begin() + static_cast<std::ptrdiff_t>(on_surface),
                      filling.points.end());
    for (Tetrahedron t : filling.tets) {
        for (VertexId& v : t) v = v < on_surface ? solid.points[v] : static_cast<VertexId>(v + shift);
        all.tets.push_back(t);
    }
    all.solid.insert(all.solid.end(), filling.solid.begin(), filling.solid.end());
}

/// Each solid's filling. A failure ends those behind it, so that the first one in the order of the solids is
/// told, whichever comes first in time.
std::vector<Filling> fill(const SolidInput& input, const std::vector<SolidSurface>& solids,
                          const NetgenOptions& options, const Progress& progress) {
    const IsolationLimits limits{options.max_seconds, options.max_bytes};
    std::vector<Filling> fillings(solids.size());
    std::vector<std::exception_ptr> errors(solids.size());
    std::atomic<std::size_t> done{0}, failed{solids.size()};
    parallel_for(solids.size(), 1, [&](std::size_t s) {
        const Progress watch([&](double) {
            progress.report(double(done) / double(solids.size()));
            return s < failed;
        });
        const std::string who =
            solids.size() == 1 ? stage : fmt::format("{}: region {}", stage, input.regions[s].region);
        try {
            const auto work = [&] { return run_netgen(input, solids[s], s, options); };
            if (s < failed) fillings[s] = filling_from_bytes(run_isolated(work, limits, who, watch), who);
        } catch (...) {
            errors[s] = std::current_exception();
            for (std::size_t first = failed; s < first && !failed.compare_exchange_weak(first, s);) continue;
        }
        ++done;
    });
    if (failed < solids.size()) std::rethrow_exception(errors[failed]);
    return fillings;
}

}  // namespace

bool have_netgen() { return true; }

TetMesh netgen_tetrahedra(const TriMesh& surface, const NetgenOptions& options, const Progress& progress) {
    options.check();
    const SolidInput input = solid_input(surface, stage, progress.part(0, 0.05));
    const std::vector<SolidSurface> solids = part(input);
    Nglib::get();  // before the processes part
    const std::vector<Filling> fillings = fill(input, solids, options, progress.part(0.05, 0.95));
    Filling all;
    all.points = input.points;
    for (std::size_t s = 0; s < solids.size(); ++s) append(fillings[s], input, solids[s], all);
    if (all.tets.size() > options.max_tets)
        throw NumericalError(fmt::format("{}: more than {} tetrahedra, the limit", stage, options.max_tets));
    TetMesh mesh = filled_mesh(std::move(all), input, true, stage);
    progress.report(1);
    return mesh;
}

#endif

}  // namespace vdbgeo

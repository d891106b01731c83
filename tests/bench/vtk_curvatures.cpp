#include <vtkCellArray.h>
#include <vtkCurvatures.h>
#include <vtkDataArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>

#include "tests/bench/curvature_peers.h"

namespace vdbgeo::bench {

std::function<PeerCurvature()> vtk_curvatures(const TriMesh& mesh) {
    const auto surface = vtkSmartPointer<vtkPolyData>::New();
    vtkNew<vtkPoints> points;
    points->SetDataTypeToDouble();
    points->SetNumberOfPoints(static_cast<vtkIdType>(mesh.points.size()));
    for (std::size_t v = 0; v < mesh.points.size(); ++v)
        points->SetPoint(static_cast<vtkIdType>(v), mesh.points[v].cast<double>().eval().data());
    vtkNew<vtkCellArray> cells;
    for (const Triangle& t : mesh.triangles) cells->InsertNextCell({t[0], t[1], t[2]});
    surface->SetPoints(points);
    surface->SetPolys(cells);
    return [surface] {
        PeerCurvature out;
        const auto run = [&](int kind, const char* name, Array<double>& values) {
            vtkNew<vtkCurvatures> filter;
            filter->SetInputData(surface);
            filter->SetCurvatureType(kind);
            filter->Update();
            vtkDataArray* array = filter->GetOutput()->GetPointData()->GetArray(name);
            values.resize(static_cast<std::size_t>(array->GetNumberOfTuples()));
            for (std::size_t v = 0; v < values.size(); ++v)
                values[v] = array->GetTuple1(static_cast<vtkIdType>(v));
        };
        run(VTK_CURVATURE_MEAN, "Mean_Curvature", out.mean);
        run(VTK_CURVATURE_GAUSS, "Gauss_Curvature", out.gauss);
        return out;
    };
}

}  // namespace vdbgeo::bench

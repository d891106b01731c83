#include "tests/bench/flying_edges.h"

#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkSMPTools.h>
#include <vtkSmartPointer.h>

namespace vdbgeo::bench {

Output flying_edges(std::vector<float>& values, const Frame& frame, double isovalue, int threads) {
    vtkSMPTools::SetBackend(threads > 1 ? "TBB" : "Sequential");
    vtkSMPTools::Initialize(threads);
    vtkNew<vtkFloatArray> scalars;
    scalars->SetArray(values.data(), static_cast<vtkIdType>(values.size()), 1);  // 1: VTK does not own it
    vtkNew<vtkImageData> image;
    const Vec3d h = frame.voxel_size();
    image->SetDimensions(frame.size.x(), frame.size.y(), frame.size.z());
    image->SetSpacing(h.x(), h.y(), h.z());
    image->SetOrigin(frame.origin.x(), frame.origin.y(), frame.origin.z());
    image->GetPointData()->SetScalars(scalars);
    vtkNew<vtkFlyingEdges3D> filter;
    filter->SetInputData(image);
    filter->SetValue(0, isovalue);
    filter->ComputeNormalsOff();
    filter->ComputeGradientsOff();
    filter->ComputeScalarsOff();
    filter->Update();
    vtkPolyData* mesh = filter->GetOutput();
    const auto keep = std::make_shared<vtkSmartPointer<vtkPolyData>>(mesh);
    return {static_cast<std::uint64_t>(mesh->GetNumberOfPolys()),
            static_cast<std::uint64_t>(mesh->GetNumberOfPoints()), keep};
}

}  // namespace vdbgeo::bench

#include "vdbgeo/view/drawing.h"

namespace vdbgeo {
namespace {

void paint(Image& image, const Drawing::Lines& lines) {
    std::vector<Segment> segments;
    for (const auto& chain : lines.chains)
        for (std::size_t i = 1; i < chain.size(); ++i) segments.push_back({chain[i - 1], chain[i]});
    draw_segments(image, segments, lines.thickness, lines.colour);
}

void paint(Image& image, const Drawing::Boxes& boxes) {
    for (const auto& b : boxes.boxes)
        fill_rectangle(image, b.x0, b.y0, b.x1, b.y1, boxes.colour, boxes.opacity);
}

void paint(Image& image, const Drawing::Text& text) {
    draw_text(image, text.position, text.text, text.size, text.colour, text.align, text.upwards);
}

}  // namespace

Image rasterise(const Drawing& drawing) {
    Image image(drawing.width, drawing.height, drawing.paper);
    for (const Drawing::Shape& shape : drawing.shapes)
        std::visit([&](const auto& s) { paint(image, s); }, shape);
    return image;
}

}  // namespace vdbgeo

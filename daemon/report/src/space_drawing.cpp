#include "abbe/report/space_drawing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "line_colours.hpp"
#include "markup.hpp"

namespace abbe::daemon {
namespace {

// Sizes in units of the SVG's view box, which is as wide as the page.
constexpr double kDrawingWidth = 720.0, kMargin = 46.0, kTitleHeight = 24.0;

struct PlanePoint {
  double x = 0.0, y = 0.0;
};

/// The view: Y is shortened and drawn to the back.
PlanePoint projected(const calib::Vector3& p_mm) {
  constexpr double kBackX = 0.42, kBackY = 0.30;
  return {p_mm.x() + kBackX * p_mm.y(), -p_mm.z() - kBackY * p_mm.y()};
}

/// All corners of a box.
std::vector<calib::Vector3> corners_of(const std::array<calib::Vector3, 2>& box_mm) {
  std::vector<calib::Vector3> corners;
  for (std::size_t k = 0; k < 8; ++k)
    corners.emplace_back(box_mm[k & 1U].x(), box_mm[(k >> 1U) & 1U].y(),
                         box_mm[(k >> 2U) & 1U].z());
  return corners;
}

/// Maps the projection of all points to the page.
class View {
 public:
  explicit View(const SpaceDrawing& drawing) {
    std::vector<calib::Vector3> all = corners_of(drawing.box_mm);
    for (const SpaceLine& line : drawing.lines) all.insert(all.end(), {line.from_mm, line.to_mm});
    PlanePoint most = low_ = projected(all.front());
    for (const calib::Vector3& p : all) {
      const PlanePoint at = projected(p);
      low_ = {std::min(low_.x, at.x), std::min(low_.y, at.y)};
      most = {std::max(most.x, at.x), std::max(most.y, at.y)};
    }
    scale_ = (kDrawingWidth - 2.0 * kMargin) / std::max(most.x - low_.x, 1.0);
    height_ = kTitleHeight + 2.0 * kMargin + scale_ * (most.y - low_.y);
  }

  [[nodiscard]] PlanePoint at(const calib::Vector3& p_mm) const {
    const PlanePoint p = projected(p_mm);
    return {kMargin + scale_ * (p.x - low_.x), kTitleHeight + kMargin + scale_ * (p.y - low_.y)};
  }
  [[nodiscard]] double height() const { return height_; }

 private:
  PlanePoint low_;
  double scale_ = 1.0, height_ = 0.0;
};

std::string text_beside(PlanePoint at, double dx, double dy, std::string_view text,
                        std::string_view more = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\"{}>{}</text>\n", at.x + dx, at.y + dy, more,
                     escaped(text));
}

std::string line_between(PlanePoint from, PlanePoint to, std::string_view more) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", from.x,
                     from.y, to.x, to.y, more);
}

/// The edges of the box; axes are named at the middle of the three edges of the first corner.
std::string frame(const View& view, const std::array<calib::Vector3, 2>& box_mm) {
  std::string out;
  const auto corners = corners_of(box_mm);
  for (std::size_t k = 0; k < corners.size(); ++k)
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (const std::size_t other = k | (std::size_t{1} << axis); other != k)
        out += line_between(view.at(corners[k]), view.at(corners[other]), "stroke=\"#b6bec6\"");

  constexpr std::array<PlanePoint, 3> kBeside{{{0.0, 16.0}, {12.0, 8.0}, {-16.0, 4.0}}};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<Eigen::Index>(axis);
    calib::Vector3 middle = box_mm[0];
    middle(k) = 0.5 * (box_mm[0](k) + box_mm[1](k));
    // the right edge, because other lines do not hide it
    if (axis == 1) middle.x() = box_mm[1].x();
    out += text_beside(view.at(middle), kBeside.at(axis).x, kBeside.at(axis).y,
                       std::string(1, "XYZ"[axis]));
  }
  return out;
}

/// Labels at the ends of the lines. Labels that would cover each other are joined.
class Labels {
 public:
  void add(PlanePoint at, const std::string& label) {
    constexpr double kNear = 9.0;
    for (auto& [other, text] : all_) {
      if (std::abs(other.x - at.x) > kNear || std::abs(other.y - at.y) > kNear) continue;
      text += ", " + label;
      return;
    }
    all_.emplace_back(at, label);
  }
  [[nodiscard]] std::string text() const {
    std::string out;
    for (const auto& [at, text] : all_) out += text_beside(at, 4.0, -4.0, text);
    return out;
  }

 private:
  std::vector<std::pair<PlanePoint, std::string>> all_;
};

}  // namespace

std::string svg(const SpaceDrawing& drawing) {
  const View view(drawing);
  std::string out = fmt::format(
      "<svg class=\"maps drawing\" viewBox=\"0 0 {} {:.1f}\" role=\"img\">\n<title>{}</title>\n",
      kDrawingWidth, view.height(), escaped(drawing.title));
  out += text_beside({0.5 * kDrawingWidth, 14.0}, 0.0, 0.0, drawing.title,
                     " class=\"title\" text-anchor=\"middle\"");
  out += frame(view, drawing.box_mm);

  Labels labels;
  for (std::size_t i = 0; i < drawing.lines.size(); ++i) {
    const SpaceLine& line = drawing.lines[i];
    const PlanePoint from = view.at(line.from_mm), to = view.at(line.to_mm);
    const auto colour = line_colour(drawing.one_colour ? 0 : i);
    out += line_between(
        from, to,
        fmt::format("stroke=\"{}\" stroke-width=\"{}\"", colour, drawing.one_colour ? 1.5 : 2.5));
    out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\"/>\n", from.x,
                       from.y, drawing.one_colour ? 2 : 4, colour);
    if (!line.label.empty()) labels.add(to, line.label);
  }
  return out + labels.text() + "</svg>\n";
}

}  // namespace abbe::daemon

// Reads bar.toml: a calibrated Multi-Feature Bar.
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "bar_pattern.hpp"
#include "expansivity.hpp"
#include "toml_file.hpp"

namespace abbe::daemon {
namespace {

using calib::mfb::Bar;
using calib::mfb::Sag;
using calib::mfb::TouchPattern;

constexpr double kBesidePattern_m = 1e-3;

/// Reads [[point]]: the calibrated points, and which of them have u_um.
class PointReader {
 public:
  /// `pattern`: null if its holes have a fault; then places and numbers are not compared with it.
  PointReader(const TouchPattern* pattern, Bar& bar) : pattern_(pattern), bar_(bar) {}

  void read(Section& root) {
    auto points = root.children("point");
    const std::size_t holes = pattern_ != nullptr ? pattern_->holes() : points.size();
    seen_.assign(holes, 0);
    bar_.O_m.assign(holes, calib::Vector3::Zero());
    u_m_.assign(holes, calib::Vector3::Zero());
    for (Section& point : points) read_point(point);
    if (pattern_ == nullptr) return;
    for (std::size_t i = 0; i < holes; ++i)
      if (seen_[i] == 0) root.fault("point", fmt::format("hole {} is missing", i + 1));
  }
  [[nodiscard]] std::size_t with_u() const { return with_u_; }
  [[nodiscard]] Eigen::MatrixXd covariance_m2() const {
    Eigen::VectorXd variances(3 * std::ssize(u_m_));
    for (std::size_t i = 0; i < u_m_.size(); ++i)
      variances.segment<3>(3 * static_cast<Eigen::Index>(i)) = u_m_[i].cwiseAbs2();
    return variances.asDiagonal();
  }
  /// Adds a fault for each point without u_um. Hole 1 needs none, because its point is exact by
  /// definition.
  void require_u(Section& root) {
    for (Section& point : root.children("point")) {
      const toml::node* hole = point.node("hole");
      if (point.has("u_um") || (hole != nullptr && hole->value<std::int64_t>() == 1)) continue;
      point.fault("u_um",
                  with_u_ > 0 ? "missing" : "missing; or state [calibration] covariance_um2");
    }
  }

 private:
  void read_point(Section& point) {
    std::size_t hole = 0;
    calib::Vector3 p_m = calib::Vector3::Zero(), u_m = calib::Vector3::Zero();
    const auto holes = static_cast<std::int64_t>(seen_.size());
    const bool known = point.get_integer("hole", hole, 1, holes, Need::Required);
    bool placed = point.get("x_mm", p_m.x(), kMilli, kAny, Need::Required);
    placed = point.get("y_mm", p_m.y(), kMilli, kAny, Need::Required) && placed;
    placed = point.get("z_mm", p_m.z(), kMilli, kAny, Need::Required) && placed;
    const bool has_u = get_vector(point, "u_um", u_m, kMicro);
    if (has_u && u_m.minCoeff() < 0.0) point.fault("u_um", "must be at least 0");
    if (point.has("u_um")) ++with_u_;
    point.close();
    if (!known) return;

    const std::size_t i = hole - 1;
    if (++seen_[i] > 1) point.fault("hole", fmt::format("hole {} has two points", hole));
    const bool belongs = !placed || pattern_ == nullptr || check_place(point, i, p_m);
    if (belongs && has_u && pattern_ != nullptr) check_fixed(point, "u_um", i, u_m);
    bar_.O_m[i] = p_m;
    u_m_[i] = u_m;
  }

  /// Adds a fault and returns false if the point lies so far away that it belongs to another hole
  /// or bar.
  bool check_place(Section& point, std::size_t i, const calib::Vector3& p_m) {
    const calib::Vector3 nominal_m(pattern_->hole_x_m[i], pattern_->hole_y_m[i], 0.0);
    const double beside_m = (p_m - nominal_m).norm();
    if (beside_m <= kBesidePattern_m) {
      check_fixed(point, "", i, p_m);
      return true;
    }
    const calib::Vector3 p_mm = p_m * kMmPerM, nominal_mm = nominal_m * kMmPerM;
    point.fault("x_mm", fmt::format("({:g}, {:g}, {:g}) is {:.3g} mm from hole {} of the pattern "
                                    "at ({:g}, {:g}, 0): another hole, bar or unit",
                                    p_mm.x(), p_mm.y(), p_mm.z(), beside_m * kMmPerM, i + 1,
                                    nominal_mm.x(), nominal_mm.y()));
    return false;
  }

  /// Checks the coordinates that define the bar axes: all of hole 1, and y and z of the last hole.
  /// They are 0, and so are their uncertainties. `key`: u_um, or empty for the coordinates.
  void check_fixed(Section& point, std::string_view key, std::size_t i,
                   const calib::Vector3& value) {
    constexpr std::array<std::string_view, 3> kKeys{"x_mm", "y_mm", "z_mm"};
    const bool first = i == 0, last = i + 1 == seen_.size();
    for (Eigen::Index c = 0; c < 3; ++c) {
      if (!(first || (last && c > 0)) || value(c) == 0.0) continue;
      point.fault(key.empty() ? kKeys[static_cast<std::size_t>(c)] : key,
                  first
                      ? "must be 0: hole 1 is the origin of the bar axes"
                      : fmt::format("{} must be 0: the last hole defines the bar axes", "xyz"[c]));
    }
  }

  const TouchPattern* pattern_;
  Bar& bar_;
  std::vector<int> seen_;
  std::vector<calib::Vector3> u_m_;
  std::size_t with_u_ = 0;
};

/// Reads a square matrix, row by row; nullopt after a fault.
std::optional<Eigen::MatrixXd> read_matrix(Section& section, std::string_view key, Unit unit,
                                           Eigen::Index size) {
  const toml::node* node = section.node(key);
  if (node == nullptr) {
    section.fault(key, "missing");
    return std::nullopt;
  }

  const toml::array* rows = node->as_array();
  Eigen::MatrixXd matrix(size, size);
  bool valid = rows != nullptr && std::ssize(*rows) == size;
  for (Eigen::Index i = 0; valid && i < size; ++i) {
    const toml::array* row = rows->get(static_cast<std::size_t>(i))->as_array();
    valid = row != nullptr && std::ssize(*row) == size;
    for (Eigen::Index j = 0; valid && j < size; ++j) {
      const auto value = row->get(static_cast<std::size_t>(j))->value<double>();
      valid = value && std::isfinite(*value);
      if (valid) matrix(i, j) = *value / unit.per_si;
    }
  }

  if (valid) return matrix;
  section.fault(key, fmt::format("must be {0} rows of {0} finite numbers", size));
  return std::nullopt;
}

void check_covariance(Section& calibration, const Eigen::MatrixXd& covariance_m2) {
  constexpr std::string_view kKey = "covariance_um2";
  constexpr double kRounding = 1e-9;
  const Eigen::Index n = covariance_m2.rows();
  const double largest = covariance_m2.cwiseAbs().maxCoeff();
  if ((covariance_m2 - covariance_m2.transpose()).cwiseAbs().maxCoeff() > kRounding * largest) {
    calibration.fault(kKey, "is not symmetric");
    return;
  }

  for (const Eigen::Index fixed : {Eigen::Index{0}, Eigen::Index{1}, Eigen::Index{2}, n - 2, n - 1})
    if (covariance_m2.row(fixed).cwiseAbs().maxCoeff() > 0.0)
      calibration.fault(kKey,
                        fmt::format("row and column {} must be 0: {} of the {} hole defines "
                                    "the bar axes",
                                    fixed + 1, "xyz"[fixed % 3], fixed < 3 ? "first" : "last"));

  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance_m2, Eigen::EigenvaluesOnly);
  const auto& values = eigen.eigenvalues();
  if (values(0) < -kRounding * values(n - 1))
    calibration.fault(
        kKey, fmt::format("has the negative eigenvalue {:.3g} um2, largest {:.3g}: "
                          "not a covariance",
                          values(0) * kUmPerM * kUmPerM, values(n - 1) * kUmPerM * kUmPerM));
}

void read_uncertainty(Section& root, PointReader& points, Bar& out) {
  Section calibration = root.child("calibration");
  if (!calibration.present()) {
    points.require_u(root);
    out.covariance_m2 = points.covariance_m2();
    return;
  }

  constexpr Unit kSquareMicro{kUmPerM * kUmPerM};
  if (points.with_u() > 0)
    calibration.fault(
        "", fmt::format("{} points also have u_um: state one of the two", points.with_u()));
  if (out.O_m.empty()) return;
  if (const auto given =
          read_matrix(calibration, "covariance_um2", kSquareMicro, 3 * std::ssize(out.O_m))) {
    check_covariance(calibration, *given);
    out.covariance_m2 = 0.5 * (*given + given->transpose());
  }
  calibration.close();
}

/// Reads two numbers; the second must be larger than the first.
bool get_interval(Section& section, std::string_view key, std::array<double, 2>& out) {
  std::vector<double> given;
  if (!section.get(key, given, kMilli, Need::Required)) return false;
  if (given.size() != 2 || !(given[0] < given[1])) {
    section.fault(key, "must be two numbers, the second larger than the first");
    return false;
  }
  out = {given[0], given[1]};
  return true;
}

void read_sag(Section& root, const TouchPattern& pattern, std::optional<Sag>& out) {
  Section section = root.child("sag");
  if (!section.present()) return;
  Sag sag;
  constexpr Unit kPerGiga{1e-9};
  const bool beam = get_interval(section, "beam_x_mm", sag.beam_x_m);
  const bool supports = get_interval(section, "supports_mm", sag.supports_m);
  if (beam && (sag.beam_x_m[0] > 0.0 ||
               (!pattern.hole_x_m.empty() && sag.beam_x_m[1] < pattern.hole_x_m.back())))
    section.fault("beam_x_mm", "does not reach from the first to the last hole");
  if (beam && supports &&
      (sag.supports_m[0] < sag.beam_x_m[0] || sag.supports_m[1] > sag.beam_x_m[1]))
    section.fault("supports_mm", "outside beam_x_mm");

  std::vector<double> section_m;
  if (section.get("section_yz_mm", section_m, kMilli, Need::Required)) {
    if (section_m.size() == 2 && section_m[0] > 0.0 && section_m[1] > 0.0)
      sag.section_yz_m = {section_m[0], section_m[1]};
    else
      section.fault("section_yz_mm", "must be two positive numbers, along y and along z");
  }
  section.get("density_kg_per_m3", sag.density_kg_per_m3, kPlain, kPositive, Need::Required);
  section.get("youngs_modulus_GPa", sag.youngs_modulus_Pa, kPerGiga, kPositive, Need::Required);
  section.close();
  out = sag;
}

Bar read_bar(Section& root, const Faults& faults) {
  Bar bar;
  Section head = root.child("bar", Need::Required);
  if (head.present()) {
    head.get("name", bar.name, Need::Required);
    read_expansivity(head, bar.expansion);
    head.close();
  }

  const bool holes_valid = read_bar_pattern(root, bar.pattern, faults);
  PointReader points(holes_valid ? &bar.pattern : nullptr, bar);
  points.read(root);
  read_uncertainty(root, points, bar);
  read_sag(root, bar.pattern, bar.sag);
  return bar;
}

}  // namespace

Result<BarFile> read_bar_toml(const std::filesystem::path& file) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  return parse_bar_toml(*text, file);
}

Result<BarFile> parse_bar_toml(std::string_view text, const std::filesystem::path& file) {
  const auto parsed = parse_toml_text(text, file);
  ABBE_TRY(parsed);
  Faults faults(file.string());
  Section root(&parsed->table, "", {1, 1}, faults);
  Bar bar = read_bar(root, faults);
  root.close();
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  if (const auto valid = calib::mfb::check(bar); !valid)
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", file.string(), valid.error().text));
  return BarFile{parsed->source, std::move(bar)};
}

}  // namespace abbe::daemon

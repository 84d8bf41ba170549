#include "otf/residual_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "abbe/base/units.hpp"
#include "abbe/report/sections.hpp"

namespace abbe::daemon {
namespace {

using calib::otf::PlacedResidual;
using ComponentNames = std::array<const char*, 3>;

constexpr ComponentNames kAcrossPath{"across the path, a2", "across the path, a3",
                                     "along the path"};
constexpr ComponentNames kOfBeam{"along the beam", "horizontally across the beam",
                                 "vertically across the beam"};
constexpr double kMostSigmas = 5.0;  // of the histogram of normalised residuals

bool of_standstills(const ModelDocument& document) {
  return document.mode == calib::otf::name(calib::otf::Mode::Standstill);
}

/// With scale readings a run has rows along the path, too.
bool has_along_rows(std::span<const RunResiduals> runs) {
  return std::ranges::any_of(runs, [](const RunResiduals& run) {
    return std::ranges::any_of(
        run, [](const PlacedResidual& r) { return r.component == calib::otf::kAlong; });
  });
}

/// One value per residual of all runs; values that are not finite are left out.
template <class Value>
std::vector<double> values_of(std::span<const RunResiduals> runs, Value value) {
  std::vector<double> out;
  for (const RunResiduals& run : runs) {
    for (const PlacedResidual& r : run) {
      if (const double v = value(r); std::isfinite(v)) out.push_back(v);
    }
  }

  return out;
}

/// Smallest, mean and largest value in each interval of the path.
class AlongPath {
 public:
  AlongPath(double length_m, std::size_t intervals)
      : width_m_(length_m / static_cast<double>(intervals)), of_(intervals) {}

  void add(double way_m, double value) {
    const double at = width_m_ > 0.0 ? std::floor(way_m / width_m_) : 0.0;
    Interval& i =
        of_[static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(of_.size() - 1)))];
    i.low = std::min(i.low, value);
    i.high = std::max(i.high, value);
    i.sum += value;
    i.count += 1.0;
  }

  /// Intervals without values are left out.
  [[nodiscard]] Curve curve(std::string_view name) const {
    Curve out{.name = std::string(name), .x = {}, .y = {}, .dot_every = 0};
    for (std::size_t k = 0; k < of_.size(); ++k) {
      const Interval& i = of_[k];
      if (!(i.count > 0.0)) continue;
      out.x.push_back((static_cast<double>(k) + 0.5) * width_m_);
      out.y.push_back(i.sum / i.count);
      out.low.push_back(i.low);
      out.high.push_back(i.high);
    }

    return out;
  }

 private:
  struct Interval {
    double low = std::numeric_limits<double>::infinity();
    double high = -std::numeric_limits<double>::infinity();
    double sum = 0.0, count = 0.0;
  };
  double width_m_;
  std::vector<Interval> of_;
};

/// Length of the path of a run, as far as it has residuals.
double length_m(const RunResiduals& run) {
  double length = 0.0;
  for (const PlacedResidual& r : run) length = std::max(length, r.way_m);
  return length;
}

/// One curve per component; the runs follow each other.
LineChart chart_along_path(std::span<const RunResiduals> runs, std::string title,
                           const ComponentNames& names, double PlacedResidual::*value) {
  constexpr std::size_t kMostIntervals = 150, kRowsInInterval = 4;
  double all_m = 0.0;
  std::array<std::size_t, 3> rows{};
  for (const RunResiduals& run : runs) {
    all_m += length_m(run);
    for (const PlacedResidual& r : run) ++rows.at(r.component);
  }

  const std::size_t intervals =
      std::clamp(std::ranges::max(rows) / kRowsInInterval, std::size_t{1}, kMostIntervals);
  std::array<AlongPath, 3> of{AlongPath(all_m, intervals), AlongPath(all_m, intervals),
                              AlongPath(all_m, intervals)};
  double before_m = 0.0;
  for (const RunResiduals& run : runs) {
    for (const PlacedResidual& r : run)
      if (std::isfinite(r.*value)) of.at(r.component).add(before_m + r.way_m, r.*value * kUmPerM);
    before_m += length_m(run);
  }

  LineChart chart{.title = std::move(title),
                  .x_label = runs.size() > 1 ? "length of the paths, one run after the other, m"
                                             : "length of the path, m",
                  .y_label = "um",
                  .wide = true};
  for (std::size_t c = 0; c < rows.size(); ++c)
    if (rows[c] > 0) chart.curves.push_back(of[c].curve(names[c]));
  return chart;
}

void add_along_path(HtmlReport& page, std::span<const RunResiduals> runs,
                    const ComponentNames& names) {
  page.paragraph(
      "Along the path: mean of each interval of the path (line) and range from its smallest to its "
      "largest value (band).");
  page.chart(
      chart_along_path(runs, "Before: error along the path", names, &PlacedResidual::before_m));
  page.chart(chart_along_path(runs, "After: residual of the fit along the path", names,
                              &PlacedResidual::after_m));
}

/// The residuals in units of their standard uncertainties, beside the distribution that these
/// uncertainties predict: a fit with n observations and f degrees of freedom leaves residuals with
/// the standard deviation sqrt(f / n).
void add_normalised(HtmlReport& page, const ModelStatistics& s,
                    std::span<const RunResiduals> runs) {
  std::vector<double> normalised =
      values_of(runs, [](const PlacedResidual& r) { return r.after_m / r.sigma_m; });
  if (normalised.empty() || s.observations <= s.rank) return;
  const auto beyond =
      std::ranges::count_if(normalised, [](double v) { return std::abs(v) > kMostSigmas; });
  for (double& v : normalised) v = std::clamp(v, -kMostSigmas, kMostSigmas);

  const double sd =
      std::sqrt(static_cast<double>(s.observations - s.rank) / static_cast<double>(s.observations));
  page.chart(Histogram{.title = "After, in standard uncertainties",
                       .x_label = "residual / its standard uncertainty",
                       .series = {{"residuals", std::move(normalised)}},
                       .normal_sd = sd,
                       .wide = true});
  page.paragraph(fmt::format(
      "Dashed: normal distribution that the stated uncertainties predict. A wider histogram means "
      "larger noise, or errors that the tables do not contain. {} of {} residuals are larger than "
      "{:.0f} standard uncertainties; they are counted at the ends.",
      beyond, s.observations, kMostSigmas));
}

}  // namespace

void add_residual_figures(HtmlReport& page, const ModelDocument& document,
                          std::span<const RunResiduals> runs) {
  constexpr int kDigits = 3;
  const ModelStatistics& s = document.statistics;
  const bool standing = of_standstills(document);
  page.heading("Residuals of the fit");
  const auto row = [](const char* what, const ResidualFigures& f) {
    return std::vector<std::string>{what, um_text(f.mean_abs_m, kDigits), um_text(f.rms_m, kDigits),
                                    um_text(f.max_abs_m, kDigits)};
  };
  page.table({"", "mean", "rms", "largest"}, {row("before", s.before), row("after", s.after)});

  const char* const components = standing               ? "along and across the beam"
                                 : has_along_rows(runs) ? "across and along the path"
                                                        : "across the path";
  const auto in_um = [runs](double PlacedResidual::*value) {
    return values_of(runs, [value](const PlacedResidual& r) { return r.*value * kUmPerM; });
  };
  page.chart(Histogram{.title = "Before",
                       .x_label = fmt::format("error {}, um", components),
                       .series = {{"before", in_um(&PlacedResidual::before_m)}}});
  page.chart(Histogram{.title = "After",
                       .x_label = fmt::format("residual {}, um", components),
                       .series = {{"after", in_um(&PlacedResidual::after_m)}}});
  add_normalised(page, s, runs);
  add_along_path(page, runs, standing ? kOfBeam : kAcrossPath);
}

std::vector<LeftError> left_errors(std::span<const RunResiduals> runs) {
  std::vector<LeftError> left;
  for (const RunResiduals& run : runs) {
    for (const PlacedResidual& r : run) {
      if (r.held_out)
        left.push_back(
            {r.axis_position_m, r.held_out->no_compensation_m, r.held_out->candidate_m, r.sigma_m});
    }
  }

  return left;
}

}  // namespace abbe::daemon

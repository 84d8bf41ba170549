#include "abbe/calib/internal/otf/standstill/observe_standstills.hpp"

#include <array>
#include <cmath>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/calib/internal/statistics/quantile_999.hpp"
#include "abbe/calib/otf/observe/known_travel.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/result/try.hpp"
#include "observe/run_times.hpp"
#include "run/progress.hpp"

namespace abbe::calib::otf {
namespace {

/// Stated standard deviation of one sample along the axes of a standstill.
Vector3 stated_sigma_m(const Standstill& s, const Noise& noise) {
  const double across_m = noise.sigma_angle_rad * s.mean_tracker_m.norm();
  return {noise.sigma_range_m, across_m, across_m};
}

/// Median over the standstills of (scatter / stated)^2, for each axis; at least 1.
Vector3 common_excess(const Standstills& all, const Noise& noise) {
  Vector3 excess = Vector3::Ones();
  for (Eigen::Index k = 0; k < 3; ++k) {
    std::vector<double> ratios;
    for (const Standstill& s : all.found) {
      const double ratio = s.scatter_m(k) / stated_sigma_m(s, noise)(k);
      ratios.push_back(ratio * ratio);
    }
    const double unsuspicious =
        1.0 + kNormal999 * std::sqrt(2.0 / static_cast<double>(all.found.front().samples));
    const double typical = median(ratios);
    excess(k) = typical > unsuspicious ? typical : 1.0;
  }
  return excess;
}

/// Squared uncertainty of the mean of a standstill along axis k, without repeatability. `sigma2`:
/// variance of one sample; `correlation`: see Standstills.
double variance_of_mean(const Standstill& s, Eigen::Index k, double sigma2, double correlation) {
  const auto n = static_cast<double>(s.samples);
  const double scatter2 = s.scatter_m(k) * s.scatter_m(k);
  const double unsuspicious = 1.0 + kNormal999 * std::sqrt(2.0 * correlation / n);
  if (scatter2 > unsuspicious * sigma2) {
    sigma2 = scatter2;
  }

  // Standard deviation of the creep from n independent samples: sigma sqrt(12 / n).
  const double variance = sigma2 * correlation / n, creep2 = s.creep_m(k) * s.creep_m(k);
  constexpr double kUniform = 12.0;  // variance of a uniform distribution of unit width: 1/12
  const bool significant = creep2 > kNormal999 * kNormal999 * kUniform * variance;
  return variance + (significant ? creep2 / kUniform : 0.0);
}

/// Alignment for the assigned standstills: "leg" and "segment" are position and standstill.
Alignment alignment_of(const StandstillAssignment& a, const Standstills& all, const Path& path) {
  Alignment alignment{.T_machine_tracker = a.T_machine_tracker,
                      .rough_T_machine_tracker = a.rough_T_machine_tracker};
  alignment.leg.assign(all.found.size(), 0);
  alignment.used.assign(all.found.size(), false);
  std::vector<Vector3> places;

  for (std::size_t j = 0; j < a.standstill_of.size(); ++j) {
    if (const auto i = a.standstill_of[j]) {
      alignment.leg[*i] = j;
      alignment.used[*i] = true;
      places.push_back(all.found[*i].mean_tracker_m);
    }
  }

  alignment.iterations = a.iterations;
  alignment.first_rms_m = alignment.last_rms_m = a.rms_m;
  alignment.measured_length_m = centroid(places).length_m;
  alignment.path_length_m = centroid(path.vertices_m).length_m;
  return alignment;
}

/// Notes about noise that exceeds what was stated.
void note_noise(std::vector<std::string>& notes, const Standstills& all, const Noise& noise) {
  constexpr std::array<const char*, 3> kAxes{"along the beam", "horizontally across the beam",
                                             "vertically across the beam"};
  const Vector3 excess = common_excess(all, noise);
  for (Eigen::Index k = 0; k < 3; ++k) {
    const char* const axis = kAxes.at(static_cast<std::size_t>(k));
    if (excess(k) > 1.0) {
      notes.push_back(message("the samples of a standstill scatter ", axis, " by ",
                              std::sqrt(excess(k)),
                              " times the stated noise: included in the uncertainty"));
    }
    if (all.correlation(k) > 1.0) {
      notes.push_back(message("the samples of a standstill are correlated ", axis, ": ",
                              all.correlation(k),
                              " of them count as one: included in the uncertainty"));
    }
  }
}

/// Appends the three rows of a position.
void append_position(Observations& o, std::size_t position, std::size_t standstill,
                     const Standstill& s, const Vector3& u_m) {
  const Vector3& nominal = o.vertices_m[position];
  const RigidTransform& T = o.alignment.T_machine_tracker;
  const PointOnPath point{.leg = position,
                          .segment = standstill,
                          .deviation_m = T * s.mean_tracker_m - o.target_offset_m - nominal,
                          .axis_position_m = nominal,
                          .frame = {},
                          .samples = static_cast<double>(s.samples)};
  std::array<MeasuredComponent, 3> components;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    components[k] = {T.R * s.axes_tracker.col(column), u_m(column)};
  }
  append_rows(o, point, std::span(&nominal, 1), components);
}

}  // namespace

std::vector<Vector3> u_of_means_m(const Standstills& all, const Noise& noise,
                                  double u_repeatability_m) {
  const Vector3 excess = common_excess(all, noise);
  std::vector<Vector3> u_m;
  u_m.reserve(all.found.size());
  for (const Standstill& s : all.found) {
    const Vector3 stated = stated_sigma_m(s, noise);
    Vector3 u;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double sigma2 = excess(k) * stated(k) * stated(k);
      u(k) = std::sqrt(variance_of_mean(s, k, sigma2, all.correlation(k)) +
                       u_repeatability_m * u_repeatability_m);
    }
    u_m.push_back(u);
  }
  return u_m;
}

Result<Observations> observe_standstills(const Standstills& all, const Machine& machine,
                                         const Path& path, const Noise& noise,
                                         const Options& options) {
  ABBE_TRY(check(noise));

  const Result<StandstillAssignment> a = assign_standstills(all.found, machine, path, options);
  ABBE_TRY(a);

  Result<Observations> empty = observations_without_rows(
      machine, path, noise, alignment_of(*a, all, path), options.backlash);
  if (!empty) {
    return empty;
  }

  Observations o = *std::move(empty);
  o.mode = Mode::Standstill;
  o.travel = travel_along(path.vertices_m, o.mode);
  o.samples = all.samples;
  o.lost_samples = all.lost_samples;
  o.segments = all.found.size();
  o.segment_s = times_of(all).of_segment_s;
  o.notes = notes_of(*a, all.found, path);
  note_noise(o.notes, all, noise);
  const std::vector<Vector3> u_m = u_of_means_m(all, noise, options.standstill.u_repeatability_m);
  const Result<std::size_t> first = first_with_backlash(o);
  ABBE_TRY(first);

  for (std::size_t j = *first; j < a->standstill_of.size(); ++j) {
    if (const auto i = a->standstill_of[j]) {
      append_position(o, j, *i, all.found[*i], u_m[*i]);
      o.covered_m.push_back(path.vertices_m[j]);
      ++o.segments_used;
    }
  }

  report(options, Stage::Observe, 1.0);
  return o;
}

}  // namespace abbe::calib::otf

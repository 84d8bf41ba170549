#include "abbe/tasks/encoder_clock.hpp"

#include <fmt/format.h>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

constexpr double kUsPerS = 1e6, kDriftPpm = 1e6;

}  // namespace

calib::otf::EncoderLog encoder_log(std::span<const EncoderRow> rows, double u_time_us) {
  calib::otf::EncoderLog log{.readings = {}, .sigma_time_s = u_time_us / kUsPerS};
  log.readings.reserve(rows.size());
  for (const EncoderRow& row : rows) {
    const AxisPosition& q = row.reading_m;
    log.readings.push_back({row.time_s, {q[0], q[1], q[2]}});
  }
  return log;
}

calib::otf::ClockMap clock_of_files(const calib::otf::ClockMap& clock, const TimesOfFile& tracker,
                                    const TimesOfFile& encoder) {
  return {clock.offset_s + (encoder.first_time_s - tracker.first_time_s), clock.drift,
          clock.origin_s + tracker.first_time_s};
}

std::string clock_text(const calib::otf::Synchronisation& s, double u_time_us) {
  return fmt::format(
      "clocks      scales minus tracker {:.3f} us at {:.3f} s of the tracker, standard "
      "uncertainty {:.3f} us;\n            drift {:.4f} ppm, standard uncertainty {:.4f} ppm\n"
      "along       {} observations along the path; times of readings within {:.1f} us "
      "(stated {:.1f} us, chi2/dof {:.3f})\n",
      s.clock.offset_s * kUsPerS, s.clock.origin_s, s.u_offset_s * kUsPerS,
      s.clock.drift * kDriftPpm, s.u_drift * kDriftPpm, s.rows, s.sigma_factor * u_time_us,
      u_time_us, s.chi2_per_dof);
}

nlohmann::json clock_json(const calib::otf::Synchronisation& s, double u_time_us) {
  return {{"offset_us", s.clock.offset_s * kUsPerS}, {"u_offset_us", s.u_offset_s * kUsPerS},
          {"drift_ppm", s.clock.drift * kDriftPpm},  {"u_drift_ppm", s.u_drift * kDriftPpm},
          {"at_tracker_time_s", s.clock.origin_s},   {"observations_along", s.rows},
          {"chi2_per_dof_along", s.chi2_per_dof},    {"uncertainty_factor_along", s.sigma_factor},
          {"u_time_us", s.sigma_factor * u_time_us}};
}

}  // namespace abbe::daemon

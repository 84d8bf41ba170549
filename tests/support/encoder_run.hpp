#pragma once
/// A MadeRun with scale readings of the machine's clock: at the times of the samples and between
/// them, with white errors of their times.

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/run/encoder_log.hpp"
#include "otf_run.hpp"

namespace abbe::tests::otf {

struct EncoderRun {
  MadeRun run;
  calib::otf::EncoderLog log;
  calib::otf::ClockMap clock;  ///< true
};

struct EncoderRunOptions {
  unsigned seed = 1;            ///< of machine and noise
  double sigma_time_s = 20e-6;  ///< true
  double stated_sigma_time_s = 20e-6;
  calib::otf::ClockMap clock{0.25, 30e-6, 0.0};
  double speed_m_s = 0.4;
};

/// As make_run(), with tables of 10 um in datum G1.
inline EncoderRun make_encoder_run(const EncoderRunOptions& wanted) {
  EncoderRun made;
  made.run = make_run({.seed = wanted.seed,
                       .noise_seed = wanted.seed,
                       .error_scale_m = 10e-6,
                       .in_datum = true,
                       .speed_m_s = wanted.speed_m_s});
  made.clock = wanted.clock;
  made.log.sigma_time_s = wanted.stated_sigma_time_s;

  std::mt19937_64 random(1000 + wanted.seed);
  std::normal_distribution<double> normal;
  const std::vector<Vector3> q = drive(made.run.path, wanted.speed_m_s, 250.0);
  const auto count = std::ssize(q);
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const double stamp_s = made.clock.machine_s(static_cast<double>(i) / 250.0);
    // the position a little earlier or later than the stamp says
    const double late = wanted.sigma_time_s * 250.0 * normal(random);
    const auto other = std::clamp<std::ptrdiff_t>(i + (late > 0.0 ? 1 : -1), 0, count - 1);
    const Vector3 step = q[static_cast<std::size_t>(other)] - q[static_cast<std::size_t>(i)];
    made.log.readings.push_back({stamp_s, q[static_cast<std::size_t>(i)] + std::abs(late) * step});
  }
  return made;
}

inline calib::Result<calib::otf::Identification> identify_with_readings(const EncoderRun& made) {
  calib::otf::Options options = made.run.options;
  options.encoders = &made.log;
  return calib::otf::identify(made.run.samples, made.run.machine, made.run.path, made.run.noise,
                              options);
}

}  // namespace abbe::tests::otf

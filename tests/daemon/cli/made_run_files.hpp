#pragma once
/// The simulated runs of tests/support/otf_run.hpp as the files that `abbe identify` reads.

#include <fmt/format.h>

#include <filesystem>
#include <random>
#include <span>
#include <string>

#include "abbe/calib/otf/run/encoder_log.hpp"
#include "otf_run.hpp"
#include "text_files.hpp"

namespace abbe::daemon::test {

/// coarse_machine() of otf_run.hpp.
inline std::string made_machine_toml(const calib::Vector3& target_m) {
  return fmt::format(
      "[machine]\nname = \"coarse mill\"\nchain = \"[w X' b Y Z (C1) t]\"\n"
      "[axes.X]\nmin_mm = -300\nmax_mm = 300\n[axes.Y]\nmin_mm = -250\nmax_mm = 250\n"
      "[axes.Z]\nmin_mm = -400\nmax_mm = 0\n"
      "[target]\noffset_mm = [{}, {}, {}]\n"
      "[model]\nnode_spacing_mm = {{ X = 200, Y = 250, Z = 200 }}\n",
      1e3 * target_m.x(), 1e3 * target_m.y(), 1e3 * target_m.z());
}

inline std::string made_path_csv(const calib::otf::Path& path) {
  std::string text = "x_mm,y_mm,z_mm\n";
  for (const auto& q : path.vertices_m)
    text += fmt::format("{:.17g},{:.17g},{:.17g}\n", 1e3 * q.x(), 1e3 * q.y(), 1e3 * q.z());
  return text;
}

inline std::string made_tracker_csv(std::span<const calib::otf::TrackerObservation> samples) {
  std::string text = "time_s,tracker_x_mm,tracker_y_mm,tracker_z_mm\n";
  for (const auto& s : samples)
    text += fmt::format("{:.17g},{:.17g},{:.17g},{:.17g}\n", s.time_s, 1e3 * s.p_tracker_m.x(),
                        1e3 * s.p_tracker_m.y(), 1e3 * s.p_tracker_m.z());
  return text;
}

inline std::string made_encoder_csv(const calib::otf::EncoderLog& log) {
  std::string text = "time_s,x_mm,y_mm,z_mm\n";
  for (const auto& r : log.readings)
    text += fmt::format("{:.17g},{:.17g},{:.17g},{:.17g}\n", r.time_s, 1e3 * r.q_m.x(),
                        1e3 * r.q_m.y(), 1e3 * r.q_m.z());
  return text;
}

/// Samples of another drive of the same machine along the same path, with the tracker at T.
inline std::vector<calib::otf::TrackerObservation> samples_from(
    const tests::otf::MadeRun& run, const calib::RigidTransform& T_machine_tracker,
    unsigned noise_seed) {
  std::mt19937_64 random(noise_seed);
  const auto layout = tests::otf::layout_of(run.machine);
  const calib::Vector3& t = run.machine.target_offset_m;
  std::vector<calib::otf::TrackerObservation> samples;
  for (const auto& q : tests::otf::drive(run.path, 0.4, 250.0)) {
    const auto V = calib::volumetric_error(layout, {run.truth.data(), layout.model_size()}, q, t);
    const calib::Vector3 p = T_machine_tracker.R.transpose() * (q + t + V - T_machine_tracker.t_m);
    samples.push_back({static_cast<double>(samples.size()) / 250.0,
                       tests::otf::with_noise(p, run.noise, 1.0, random), true});
  }
  return samples;
}

}  // namespace abbe::daemon::test

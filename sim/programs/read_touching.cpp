#include "read_touching.hpp"

namespace abbe::sim {
namespace {

void read_count(TomlSection& section, std::string_view key, std::size_t& value) {
  constexpr std::int64_t kMost = 1000;
  std::int64_t count = 0;
  if (section.integer(key, count, 1, kMost)) value = static_cast<std::size_t>(count);
}

}  // namespace

void read_sim_evemu(TomlSection section, LoadedSetup& setup) {
  TouchingOptions& touching = setup.touching;
  read_count(section, "points_per_ball", touching.points_per_ball);
  read_count(section, "points_per_block", touching.points_per_block);
  section.number("probing_mm_per_s", touching.probing_m_per_s, kMilli, kPositiveNumber);
  section.number("travel_mm_per_s", touching.travel_m_per_s, kMilli, kPositiveNumber);
  section.number("noise_um", touching.noise_m, kMicro, kNotNegativeNumber);
  section.number("delay_us", touching.delay_s, kMicro, kNotNegativeNumber);
  section.number("jitter_us", touching.jitter_s, kMicro, kNotNegativeNumber);
  section.number("sag_um", setup.weak_stiffness.sag_m, kMicro);
  section.number("periodic_um", setup.weak_stiffness.periodic_m, kMicro);
  section.number("period_mm", setup.weak_stiffness.period_m, kMilli, kPositiveNumber);
  section.refuse_unknown_keys();
}

void read_ball_array(TomlSection section, ArrayState& array) {
  section.number("temperature_C", array.temperature_C, 1.0, {-50.0, 100.0});
  section.number("alpha_um_per_m_K", array.alpha_per_K, kMicro, {-50.0, 50.0});
  section.number("u_alpha_um_per_m_K", array.u_alpha_per_K, kMicro, {0.0, 50.0});
  section.number("u_ball_um", array.u_ball_m, kMicro, kNotNegativeNumber);
  section.number("u_block_urad", array.u_block_rad, kMicro, kNotNegativeNumber);
  section.refuse_unknown_keys();
}

}  // namespace abbe::sim

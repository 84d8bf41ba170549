#include "read_touching.hpp"

namespace abbe::sim {
namespace {

constexpr std::int64_t kMostPoints = 1000;

}  // namespace

void read_sim_evemu(Section section, LoadedSetup& setup) {
  TouchingOptions& touching = setup.touching;
  section.get_integer("points_per_ball", touching.points_per_ball, 1, kMostPoints);
  section.get_integer("points_per_block", touching.points_per_block, 1, kMostPoints);
  section.get("probing_mm_per_s", touching.probing_m_per_s, kMilli, kPositiveNumber);
  section.get("travel_mm_per_s", touching.travel_m_per_s, kMilli, kPositiveNumber);
  section.get("noise_um", touching.noise_m, kMicro, kNotNegativeNumber);
  section.get("delay_us", touching.delay_s, kMicro, kNotNegativeNumber);
  section.get("jitter_us", touching.jitter_s, kMicro, kNotNegativeNumber);
  section.get("sag_um", setup.weak_stiffness.sag_m, kMicro, kAnyNumber);
  section.get("periodic_um", setup.weak_stiffness.periodic_m, kMicro, kAnyNumber);
  section.get("period_mm", setup.weak_stiffness.period_m, kMilli, kPositiveNumber);
  section.close(Hint::AllKeys);
}

void read_ball_array(Section section, ArrayState& array) {
  section.get("temperature_C", array.temperature_C, kPlain, {-50.0, 100.0});
  section.get("alpha_um_per_m_K", array.alpha_per_K, kMicro, {-50.0, 50.0});
  section.get("u_alpha_um_per_m_K", array.u_alpha_per_K, kMicro, {0.0, 50.0});
  section.get("u_ball_um", array.u_ball_m, kMicro, kNotNegativeNumber);
  section.get("u_block_urad", array.u_block_rad, kMicro, kNotNegativeNumber);
  section.close(Hint::AllKeys);
}

}  // namespace abbe::sim

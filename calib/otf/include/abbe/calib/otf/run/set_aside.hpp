#pragma once
/// Samples of a run that aligned_segments() excluded (set aside), by reason.

#include <cstddef>
#include <string>

namespace abbe::calib::otf {

struct SetAside {
  std::size_t of_samples = 0;  ///< number of valid samples of the run, including the excluded ones
  /// Samples at places that the target cannot have reached from the places before and after:
  /// another reflector, a spike.
  std::size_t unreachable = 0;
  /// Samples off the line through their neighbours, across the direction of travel.
  std::size_t off_line = 0;
  /// Segments whose samples scatter more than those of the run; their uncertainty is increased.
  std::size_t noisy_segments = 0;
  std::size_t longest = 0;      ///< number of samples of the longest uninterrupted excluded part
  double longest_from_s = 0.0;  ///< beginning of this part, relative to the first sample of the run
  std::size_t worst_leg = 0;    ///< leg with most excluded samples
  std::size_t on_worst_leg = 0;

  [[nodiscard]] std::size_t samples() const { return unreachable + off_line; }
  [[nodiscard]] bool any() const { return samples() > 0 || noisy_segments > 0; }
};

/// If a larger share of the samples is excluded, set_aside_text() asks for a check of the set-up.
inline constexpr double kManySetAside = 0.02;
/// If a larger share of the samples is excluded, judge() refuses the model (cause "outliers").
inline constexpr double kMostSetAside = 0.2;

/// One sentence for the verdict: number of excluded samples, reason, and the leg with most of them.
[[nodiscard]] std::string set_aside_text(const SetAside&);

}  // namespace abbe::calib::otf

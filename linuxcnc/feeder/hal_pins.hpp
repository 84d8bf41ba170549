// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// The feeder's component in HAL. Lengths in mm, as LinuxCNC's machine units must be. Used by one
/// thread.

#include <array>
#include <optional>
#include <string>

namespace abbe::linuxcnc {

class HalPins {
 public:
  static constexpr int kJoints = 3;
  using Triple = std::array<double, kJoints>;

  /// Creates the component "abbe-feeder" with its pins (README.md). nullopt: refused by HAL, with
  /// the reason in `error`.
  [[nodiscard]] static std::optional<HalPins> create(std::string& error);
  ~HalPins();
  HalPins(HalPins&& other) noexcept;
  HalPins& operator=(HalPins&&) = delete;

  [[nodiscard]] Triple positions_mm() const;
  [[nodiscard]] bool homed() const;
  /// Writes between the two sequence numbers, so that the realtime component detects a torn read.
  void write(const Triple& correction_mm, bool valid);

 private:
  struct Pins;
  HalPins(int id, Pins* pins) : id_(id), pins_(pins) {}
  int id_;
  Pins* pins_;  ///< in the shared memory of HAL
};

}  // namespace abbe::linuxcnc

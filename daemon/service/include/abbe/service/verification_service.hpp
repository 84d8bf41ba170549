#pragma once
/// Collects the points of a verification in the running daemon, for `abbe verify --live`: begun and
/// ended over the control socket, one at a time. Whoever begins later takes over, so that nobody
/// who went away blocks it. One nobody ends stops at kMostPoints. Used by the hub's thread only.

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"
#include "abbe/pipeline/standstill_points.hpp"

namespace abbe::daemon {

class VerificationService {
 public:
  /// Standstills of one verification: four hours of one every 1.5 s, 1.2 MB.
  static constexpr std::size_t kMostPoints = 10'000;

  explicit VerificationService(const Config& config) : config_(config) {}

  /// The number by which whoever began it asks for it.
  [[nodiscard]] Result<std::uint64_t> begin();
  /// The standstill that goes on is its last point.
  [[nodiscard]] Result<void> end(std::uint64_t number);
  /// Refused once somebody else has begun another.
  [[nodiscard]] Result<const StandstillPoints*> points(std::uint64_t number) const;
  /// Why no more points come although it was not ended; empty: they do.
  [[nodiscard]] std::string stopped() const;

  void cycle(std::span<const protocol::Snapshot> snapshots);

 private:
  const Config& config_;
  std::uint64_t number_ = 0;
  bool running_ = false;
  StandstillPoints points_;
};

}  // namespace abbe::daemon

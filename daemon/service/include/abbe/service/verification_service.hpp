#pragma once
/// Collects the points of a verification in the running daemon, for `abbe verify --live`. Clients
/// begin and end a verification over the control socket. Only one verification runs at a time: a
/// new one supersedes the previous one, so that a client that exited without ending its
/// verification blocks no other client. A verification that is not ended stops at kMostPoints. Used
/// by the hub's thread only.

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
  /// Most standstills of one verification: enough for four hours with one standstill every 1.5 s;
  /// 1.2 MB of memory.
  static constexpr std::size_t kMostPoints = 10'000;

  explicit VerificationService(const Config& config) : config_(config) {}

  /// Begins a verification and returns its number, which end() and points() require.
  [[nodiscard]] Result<std::uint64_t> begin();
  /// Ends the verification. The present standstill becomes its last point.
  [[nodiscard]] Result<void> end(std::uint64_t number);
  /// The points so far. Refused after another verification was begun.
  [[nodiscard]] Result<const StandstillPoints*> points(std::uint64_t number) const;
  /// The reason why no more points are taken although end() was not called; empty: points are still
  /// taken.
  [[nodiscard]] std::string stopped() const;
  /// The name of the machine in the configuration.
  [[nodiscard]] const std::string& machine() const noexcept { return config_.machine.name; }

  void cycle(std::span<const protocol::Snapshot> snapshots);

 private:
  const Config& config_;
  std::uint64_t number_ = 0;
  bool running_ = false;
  StandstillPoints points_;
};

}  // namespace abbe::daemon

#pragma once
/// The motion of a machine that follows a control: axis positions that arrive as position records
/// (abbe/protocol/position_record.hpp), one for each servo cycle.
///
/// The time of a record follows from the number of its cycle: cycle x period + offset. The offset
/// is the smallest difference between arrival and cycle x period, so that a record that arrives
/// late does not delay the machine. The offset grows by 100 ppm, so that it follows a control whose
/// period is longer than stated. Between two records the position is interpolated linearly. After
/// the newest record the motion continues for 20 ms, then the machine stops. Records are kept for 2
/// s. Thread-safe.

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>

#include "abbe/protocol/position_record.hpp"
#include "abbe/sim/path_motion.hpp"
#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

class FollowedMotion {
 public:
  /// Adds a record. Special cases: if the control is not homed, the record is counted and the
  /// machine stands still; if the record is not newer than the newest one, it is discarded. If the
  /// control has started again (cycle or period does not continue the earlier records) or was homed
  /// again, the earlier records are discarded.
  /// `dated`: `arrival` may be used for the offset. False for the second and all further records of
  /// one reading of the socket, which may have arrived after the clock was read.
  void add(const protocol::PositionRecord& record, HostTime arrival, bool dated = true);

  /// The motion at time `at`; nullopt before the first record of a homed control.
  [[nodiscard]] std::optional<AxisMotion> at(HostTime at) const;
  [[nodiscard]] std::optional<HostTime> first() const;  ///< time of the first record

  struct Counts {
    std::uint64_t received = 0;   ///< records of a homed control
    std::uint64_t not_homed = 0;  ///< received before the control was homed
    std::uint64_t lost = 0;       ///< records missing between the numbers of two records
    std::uint64_t restarts = 0;
  };
  [[nodiscard]] Counts counts() const;

 private:
  struct Place {
    std::int64_t cycle;
    Eigen::Vector3d q_m;
    std::array<int, 3> direction;
  };
  [[nodiscard]] HostTime time_of(const Place& place) const;
  [[nodiscard]] bool continues(const protocol::PositionRecord& record, std::int64_t cycle,
                               HostTime arrival) const;
  void restart(const protocol::PositionRecord& record);

  mutable std::mutex mutex_;
  std::deque<Place> places_;  ///< ascending cycles
  std::chrono::nanoseconds period_{0}, offset_{0};
  std::uint32_t newest_number_ = 0;
  std::int64_t newest_cycle_ = 0;  ///< continues beyond 32 bits
  bool homed_ = false;             ///< the newest record states that the control is homed
  std::optional<HostTime> first_;
  Counts counts_;
};

}  // namespace abbe::sim

#pragma once
/// Solves the tables of a running calibration in the background, every few seconds, and keeps the
/// latest result. Used by the hub's thread only. cycle() does not wait: it passes the new points to
/// a task and takes the result of the last one. A task owns all it uses.

#include <chrono>
#include <cstdint>
#include <future>
#include <memory>

#include "abbe/methods/calibration_session.hpp"

namespace abbe::daemon {

class OtfLiveTables;

class LiveTablesWatch {
 public:
  /// Shortest time between two solutions, host time.
  static constexpr std::chrono::seconds kPeriod{2};

  explicit LiveTablesWatch(std::shared_ptr<const Config> config);
  ~LiveTablesWatch();
  LiveTablesWatch(const LiveTablesWatch&) = delete;
  LiveTablesWatch& operator=(const LiveTablesWatch&) = delete;

  void cycle(CalibrationSession& session, protocol::HostTime now);
  /// Of the present session; null before the first solution.
  [[nodiscard]] const std::shared_ptr<const LiveTables>& latest() const noexcept { return latest_; }

 private:
  /// The state of the accumulation travels with the task, so that it needs no lock.
  struct Solved {
    std::unique_ptr<OtfLiveTables> state;      ///< null: an internal error
    std::shared_ptr<const LiveTables> tables;  ///< null: not determined
  };
  struct Task;
  void take_result();
  void forget();

  std::shared_ptr<const Config> config_;
  std::uint64_t session_ = 0;  // id
  bool failed_ = false;        // this session has no more tables: its points are lost
  std::unique_ptr<OtfLiveTables> state_;
  std::future<Solved> task_;
  std::uint64_t task_session_ = 0;  // of task_
  protocol::HostTime next_at_{};
  std::shared_ptr<const LiveTables> latest_;
};

}  // namespace abbe::daemon

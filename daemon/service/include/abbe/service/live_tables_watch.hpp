#pragma once
/// Computes the tables of a running calibration in the background every few seconds and keeps the
/// latest result. Used by the hub's thread only. cycle() does not wait: it passes the new points to
/// a background task and takes the result of the previous task. A task owns all objects that it
/// uses.

#include <chrono>
#include <cstdint>
#include <future>
#include <memory>

#include "abbe/methods/calibration_session.hpp"

namespace abbe::daemon {

class OtfLiveTables;

class LiveTablesWatch {
 public:
  /// Shortest time between two computations, in host time.
  static constexpr std::chrono::seconds kPeriod{2};

  explicit LiveTablesWatch(std::shared_ptr<const Config> config);
  ~LiveTablesWatch();
  LiveTablesWatch(const LiveTablesWatch&) = delete;
  LiveTablesWatch& operator=(const LiveTablesWatch&) = delete;

  void cycle(CalibrationSession& session, protocol::HostTime now);
  /// The latest tables of the present session; null before the first result.
  [[nodiscard]] const std::shared_ptr<const LiveTables>& latest() const noexcept { return latest_; }

 private:
  /// Result of a task. The state of the accumulation is passed to each task and returned by it, so
  /// that it needs no lock.
  struct Solved {
    std::unique_ptr<OtfLiveTables> state;      ///< null: an internal error
    std::shared_ptr<const LiveTables> tables;  ///< null: the points do not determine the tables yet
  };
  struct Task;
  void take_result();
  void forget();

  std::shared_ptr<const Config> config_;
  std::uint64_t session_ = 0;  // id of the session
  // this session gets no more tables, because its points were lost in a failed task
  bool failed_ = false;
  std::unique_ptr<OtfLiveTables> state_;
  std::future<Solved> task_;
  std::uint64_t task_session_ = 0;  // session to which task_ belongs
  protocol::HostTime next_at_{};
  std::shared_ptr<const LiveTables> latest_;
};

}  // namespace abbe::daemon

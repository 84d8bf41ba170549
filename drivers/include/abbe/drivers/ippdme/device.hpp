#pragma once
/// A measuring machine with an I++ DME server, as a Device: IppReceiver and IppSession over one TCP
/// connection. Its touches have the same type as those of the counter card: each measured point
/// gives a ProbeTrigger, each failed point a ProbeTrigger without position. The states of the
/// device are those of IppState.

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/emergency_stop.hpp"
#include "abbe/drivers/ippdme/receiver.hpp"
#include "abbe/drivers/ippdme/session.hpp"
#include "abbe/drivers/mailbox.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/session_over_tcp.hpp"

namespace abbe::drivers {

/// State of the machine that must be kept over a restart of the daemon.
struct IppMachine {
  std::string held;     ///< reason why the machine awaits a release; empty if it does not
  bool moving = false;  ///< the machine is moving, or was when the connection was lost
  friend bool operator==(const IppMachine&, const IppMachine&) = default;
};

struct IppStored {
  bool done = false;
  std::string fault;  ///< text why the latest attempt failed; empty: none failed, or `done` is true
};

struct IppDeviceOptions {
  std::string name = "cmm";
  std::string host = "127.0.0.1";
  std::uint16_t port = ippdme::kPort;
  IppSessionOptions session;  ///< `peer` is made from name, host and port
  IppReceiverOptions receiver;
  /// Called on the device thread at every change of the state: before the first command of a
  /// motion, when the machine has stopped, when a hold begins or ends. (A hold means that the
  /// machine awaits a release by an operator.) The function must not wait, because the same thread
  /// sends AbortE. Let another thread store the value, and pass it in session.held and
  /// session.moving after a restart.
  std::function<void(const IppMachine&)> machine_changed;
  /// States whether the latest value passed to machine_changed is stored. Called on the device
  /// thread; must not wait. A motion is sent only after its state is stored; if the state cannot be
  /// stored, the motion is not sent. Empty: each value counts as stored at once.
  std::function<IppStored()> machine_stored;
  std::size_t touch_capacity = 256;
  std::size_t position_capacity = 256;  ///< 25 s at 10 positions per second
  std::size_t raw_capacity_blocks = 256;
};

/// The types of I++ DME that SessionOverTcp needs, passed as its parameter `Words`.
struct IppWords {
  using Session = IppSession;
  using Input = IppInput;
  using Action = IppAction;
  using Open = IppOpen;
  using Send = IppSend;
  using Close = IppClose;
  using Connected = IppConnected;
  using ConnectionLost = IppConnectionLost;
  using Message = std::variant<IppAck, IppComplete, IppData, IppError, IppProtocolError>;
  static constexpr std::size_t kInbox = 256;
  static constexpr std::size_t kMostRead = 4096;
};

class IppDevice final : public Device, private SessionOverTcp<IppDevice, IppWords> {
 public:
  /// `time` must outlive the device. Error BadConfiguration as check(). The first wait() opens the
  /// connection.
  [[nodiscard]] static Result<std::unique_ptr<IppDevice>> create(const IppDeviceOptions& options,
                                                                 const TimeSource& time);
  /// Calls finish().
  ~IppDevice() override;

  /// Stops a motion in progress, waits for the answer to AbortE (at most command_timeout; if the
  /// connection is lost, connect_timeout before for another one), and ends the session without
  /// waiting for the answer to EndSession. Returns whether the motion is stopped. Call it after the
  /// device thread has ended. A second call returns the same.
  IppStop finish();

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;
  /// Sends AbortE for a motion in progress, on a new connection if the present one is lost.
  [[nodiscard]] bool stop_after_failure() override;

  /// Any thread. Moves the machine to the point and touches there. Points are measured in the order
  /// of the calls; each touch gives one ProbeTrigger, numbered from 1 in that order. Points that
  /// are not begun when the connection is lost, and points requested before the session is ready,
  /// are discarded; each case is a fault.
  void measure(const ProbePoint& point) { measure(std::span{&point, 1}); }
  /// Same as measure() of one point, but for a path. If the connection is lost, all remaining
  /// points are discarded: driving only a part of the path could lead to a collision. A path with a
  /// point that I++ DME cannot express is discarded as a whole: see check().
  void measure(std::span<const ProbePoint> points);
  /// Any thread; takes no lock. Stops a motion in progress (AbortE) and discards all points. The
  /// session then awaits release(), whether or not the machine was moving. Returns the number of
  /// the request; last_stop() returns its outcome.
  std::uint64_t abort();
  /// Any thread. The latest request that the session has received, and its outcome.
  [[nodiscard]] IppStop last_stop() const;
  /// Any thread. Call after an operator has inspected the machine: clears the errors and restarts
  /// the session. No effect unless releasable().
  void release();
  /// Any thread. True if the machine awaits a release, in every state: also while its server is not
  /// reachable, or while its motion is still being stopped.
  [[nodiscard]] bool held() const noexcept { return held_.load(std::memory_order_relaxed); }
  /// Any thread. True if held() and no motion is still being stopped.
  [[nodiscard]] bool releasable() const noexcept {
    return releasable_.load(std::memory_order_relaxed);
  }
  /// Any thread; takes no lock. Stops a motion in progress and ends the session, as the destructor
  /// does. No further motion is begun, and no release is awaited. For a program that is ending and
  /// may not reach the destructor.
  void end();
  /// Any thread. Number of requested points that are neither finished nor discarded. 0: the touches
  /// of all begun points are in the ring.
  [[nodiscard]] std::size_t points_left() const noexcept {
    // acquire: pairs with the release in count_points(). finished_ is read first, so that the
    // result is never too small.
    const auto finished = finished_.load(std::memory_order_acquire);
    return asked_.load(std::memory_order_relaxed) - finished;
  }

  /// One reader thread for each ring.
  [[nodiscard]] SampleRing<protocol::ProbeTrigger>& touches() noexcept { return touches_; }
  [[nodiscard]] SampleRing<protocol::AxisSample>& positions() noexcept { return positions_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }

 private:
  friend class SessionOverTcp<IppDevice, IppWords>;

  IppDevice(const IppDeviceOptions& options, TcpPeer peer, const TimeSource& time);

  using Request = std::variant<IppPath, IppAbortRequested, IppReleaseRequested, IppStopRequested>;

  [[nodiscard]] std::span<const std::byte> encode(const IppSend& command);
  void connected();
  void disconnected() { emergency_stop_.set_socket(-1); }
  void read_requests();
  [[nodiscard]] static bool is_stop(const Request& request);
  void read_stops(const std::vector<Request>& requests);
  void await_standstill();
  void count_points();
  void report_machine();
  void show_session();
  void show_stop();
  void show_condition();
  void begin_stored_motion();
  [[nodiscard]] IppStored stored() const;

  void take(const protocol::AxisSample& sample) ABBE_RT;
  void take(const protocol::ProbeTrigger& touch) ABBE_RT;
  template <class M>
  void take(const M& message) ABBE_RT {
    post(message);
  }

  IppDeviceOptions options_;
  SampleRing<protocol::ProbeTrigger> touches_;
  SampleRing<protocol::AxisSample> positions_;
  RawRing raw_;
  IppReceiver receiver_;

  Mailbox<Request> requests_;  ///< written by the hub without a lock
  std::size_t taken_ = 0;      ///< points that the device thread took from requests_
  std::atomic<std::size_t> asked_{0};
  std::atomic<std::size_t> finished_{0};
  // relaxed: independent values
  std::atomic<bool> held_{false};
  std::atomic<bool> releasable_{false};
  EmergencyStop emergency_stop_{"E0002 AbortE()\r\n", "E0002 %"};
  IppMachine machine_;                               ///< last value passed to machine_changed
  std::string condition_;                            ///< last value shown
  std::optional<protocol::HostTime> unsaved_since_;  ///< machine_ is not stored since then
  std::atomic<std::uint64_t> stops_asked_{0};
  bool ended_ = false;  ///< finish() has returned
  IppStop stop_;        ///< last value shown
  FaultText stop_text_;
  /// number * kOutcomes + outcome: one value, because both change together
  std::atomic<std::uint64_t> stop_shown_{0};
};

}  // namespace abbe::drivers

#pragma once
/// A measuring machine behind an I++ DME server, as a Device: IppReceiver and IppSession around one
/// TCP connection. A second source of touches behind the same vocabulary as the counter card's:
/// each measured point is a ProbeTrigger, a failed one a ProbeTrigger without position. States:
/// those of IppState.

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/ippdme/receiver.hpp"
#include "abbe/drivers/ippdme/session.hpp"
#include "abbe/drivers/mailbox.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/session_over_tcp.hpp"

namespace abbe::drivers {

/// What the next run must know.
struct IppMachine {
  std::string held;     ///< why the machine awaits a release; empty: it does not
  bool moving = false;  ///< a motion is under way, or was when the connection was lost
  friend bool operator==(const IppMachine&, const IppMachine&) = default;
};

struct IppDeviceOptions {
  std::string name = "cmm";
  std::string host = "127.0.0.1";
  std::uint16_t port = ippdme::kPort;
  IppSessionOptions session;  ///< `peer` is made from name, host and port
  IppReceiverOptions receiver;
  /// Device thread: what must be kept over a restart, and handed back in session.held and
  /// session.moving. Called with each change: before the first command of a motion is sent, when
  /// the machine has stopped, when a hold begins or ends.
  std::function<void(const IppMachine&)> machine_changed;
  std::size_t touch_capacity = 256;
  std::size_t position_capacity = 256;  ///< 25 s at 10 a second
  std::size_t raw_capacity_blocks = 256;
};

/// For SessionOverTcp.
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
  /// `time` must outlive the device. BadConfiguration as check(). The connection is opened by the
  /// first wait().
  [[nodiscard]] static Result<std::unique_ptr<IppDevice>> create(const IppDeviceOptions& options,
                                                                 const TimeSource& time);
  /// Stops a motion that is under way, waits for the answer to AbortE (at most command_timeout),
  /// and ends the session without waiting for the answer.
  ~IppDevice() override;

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// Any thread: moves the machine and touches, in the order of the calls; one ProbeTrigger each,
  /// numbered from 1 in that order. Points not yet begun are forgotten when the connection is lost,
  /// and so are all that come before the session is ready: a fault each time.
  void measure(const ProbePoint& point) { measure(std::span{&point, 1}); }
  /// All of them or, when the connection is lost in between, nothing of the rest: half a way to a
  /// touch leads through whatever stands there.
  void measure(std::span<const ProbePoint> points);
  /// Any thread: stops a motion that is under way (AbortE) and forgets all points. The session
  /// awaits release(), whether or not the machine moved.
  void abort();
  /// Any thread: a person has looked at the machine: errors are cleared, the session begins anew.
  /// Nothing happens unless releasable().
  void release();
  /// Any thread: the machine awaits a release, whatever the state: also while its server is away,
  /// or its motion is still being stopped.
  [[nodiscard]] bool held() const noexcept { return held_.load(std::memory_order_relaxed); }
  /// Any thread: held(), and its motion is not still being stopped.
  [[nodiscard]] bool releasable() const noexcept {
    return releasable_.load(std::memory_order_relaxed);
  }
  /// Any thread, takes no lock: a motion that is under way is stopped and the session ends, as when
  /// this is destroyed; nothing is begun any more, and no release is awaited. For a program that
  /// ends and cannot tell whether it will come to destroy this.
  void end();
  /// Any thread: how many of them are neither done nor given up. 0: the touches of all that were
  /// begun are in the ring.
  [[nodiscard]] std::size_t points_left() const noexcept {
    // acquire: pairs with the release in count_points(). In this order: never less than there are.
    const auto finished = finished_.load(std::memory_order_acquire);
    return asked_.load(std::memory_order_relaxed) - finished;
  }

  /// One reader each.
  [[nodiscard]] SampleRing<protocol::ProbeTrigger>& touches() noexcept { return touches_; }
  [[nodiscard]] SampleRing<protocol::AxisSample>& positions() noexcept { return positions_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }

 private:
  friend class SessionOverTcp<IppDevice, IppWords>;

  IppDevice(const IppDeviceOptions& options, TcpPeer peer, const TimeSource& time);

  [[nodiscard]] std::span<const std::byte> encode(const IppSend& command);
  void connected();
  void disconnected() {}
  void read_requests();
  void ask_for(const std::vector<ProbePoint>& points);
  void await_standstill();
  void count_points();
  void report_machine();
  void show_session();

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

  using Request = std::variant<std::vector<ProbePoint>, IppAbortRequested, IppReleaseRequested,
                               IppStopRequested>;
  Mailbox<Request> requests_;  ///< the hub asks and takes no lock
  std::size_t taken_ = 0;      ///< points out of it, by the device thread
  std::atomic<std::size_t> asked_{0};
  std::atomic<std::size_t> finished_{0};
  // relaxed: each stands for itself
  std::atomic<bool> held_{false};
  std::atomic<bool> releasable_{false};
  IppMachine machine_;  ///< as reported
};

}  // namespace abbe::drivers

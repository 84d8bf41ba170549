#pragma once
/// The requests to a counter card and their order: open and self-test, counter set-up, scan start,
/// status poll, restart after an overrun, reopening after removal. A set-up zeroes the counters.
/// Therefore, after reopening, the scan starts without a set-up; the counters are set up only if
/// the clock count has not continued. Sans-I/O: inputs and a time in, one action out. After each
/// input, call on(CardTick) until it returns CardNothing. Not for the RT path. One thread.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "abbe/drivers/counter_card/wiring.hpp"
#include "abbe/drivers/deadlines.hpp"
#include "abbe/drivers/usb/usb_link.hpp"
#include "abbe/protocol/quad08/sequences.hpp"

namespace abbe::drivers {

struct CounterCardSessionOptions {
  std::string peer = "counter card";  ///< prefix of every message
  CounterCardWiring wiring;
  UsbBulkStream stream;
  std::chrono::nanoseconds open_timeout = std::chrono::seconds{2};
  std::chrono::nanoseconds control_timeout = std::chrono::milliseconds{500};
  /// Longest time without scans; after it the session reports a fault. With 90 ms the fault is
  /// reported within 100 ms of the last scan.
  std::chrono::nanoseconds silence = std::chrono::milliseconds{90};
  std::chrono::nanoseconds status_period = std::chrono::milliseconds{100};
  std::chrono::nanoseconds reopen_after = std::chrono::milliseconds{250};
  /// wait after a restart without scans
  std::chrono::nanoseconds retry_after = std::chrono::milliseconds{500};
  /// attempts for a request that fails or that the card refuses, before the device is closed
  unsigned control_tries = 3;
  /// Serial number of a card whose counters an earlier run of the program has set up: they are set
  /// up again only if they have not continued.
  std::optional<std::string> set_up_serial;
};

// Inputs.
struct CardTick {
  /// All inputs that arrived before this instant were passed to the session. Time-outs are measured
  /// up to it, so that no time-out expires while a delayed host has unread input.
  protocol::HostTime read_until = protocol::HostTime::max();
};
struct CardScans {
  std::size_t count = 0;
};
struct CardOutOfStep {
  std::string seen;
};
/// Input: the clock count has not continued, so the card was restarted or set up by another
/// program.
struct CardRestarted {
  std::string seen;  ///< text with the observed clock error; may be empty
};
struct CardBulkFailed {
  UsbOutcome outcome = UsbOutcome::Failed;
};
using CardInput = std::variant<CardTick, UsbOpened, UsbControlDone, UsbBulkStopped, UsbLost,
                               CardScans, CardOutOfStep, CardRestarted, CardBulkFailed>;

// Actions.
struct CardNothing {};
struct CardOpen {};
struct CardClose {};
struct CardControl {
  usb::Setup setup;
};
struct CardStartBulk {};
struct CardStopBulk {};
using CardAction =
    std::variant<CardNothing, CardOpen, CardClose, CardControl, CardStartBulk, CardStopBulk>;

enum class CardState : std::uint8_t {
  Closed,
  Opening,
  Testing,    ///< firmware version and registers
  SettingUp,  ///< zeroes the counters; skipped while they may have continued
  Loading,    ///< stops a running scan, loads scan list and pacer
  Arming,     ///< starts data transfer and scan list, waits until the card is ready
  Streaming,
  Halting,  ///< halts the scan before a restart: from Streaming to Loading
};
/// A string literal, for DeviceStatus.
[[nodiscard]] const char* name_of(CardState state) noexcept;

class CounterCardSession {
 public:
  explicit CounterCardSession(const CounterCardSessionOptions& options);

  [[nodiscard]] CardAction on(const CardInput& input, protocol::HostTime now);
  /// The time at which the next CardTick is due.
  [[nodiscard]] protocol::HostTime deadline() const {
    return std::min(awaited_.next(), planned_.next(waiting()));
  }

  [[nodiscard]] CardState state() const { return state_; }
  /// The device is connected, its identity matches, and it has passed the self-test.
  [[nodiscard]] bool connected() const { return state_ > CardState::Testing; }

  /// A control transfer is pending.
  [[nodiscard]] bool asking() const { return asked_; }

  struct Fault {
    std::uint64_t count = 0;
    std::string text;  ///< text of the latest fault
  };
  [[nodiscard]] const Fault& fault() const { return fault_; }
  /// Number of restarts of the scan.
  [[nodiscard]] std::uint64_t restarts() const { return restarts_; }

 private:
  using Now = protocol::HostTime;
  /// Inputs with a deadline: it is a fault if the input has not arrived by then.
  enum class Input : std::uint8_t { Opened, ControlDone, BulkStopped, Scans };
  /// Actions of the session when a deadline of planned_ has passed.
  enum class Plan : std::uint8_t {
    Open,
    Step,    ///< the next request of the stage, or the halt of the scan
    Retry,   ///< restarts the scan again: no scans have arrived since the last restart
    Status,  ///< status query
  };
  static constexpr std::array kAfterAnswer{Plan::Step, Plan::Retry, Plan::Status};
  static constexpr std::array kWhileStreaming{Plan::Retry};
  [[nodiscard]] std::span<const Plan> waiting() const;
  CardAction is_missing(Input input, Now now);
  CardAction take(const CardTick& tick, Now now);
  CardAction take(const UsbOpened& opened, Now now);
  CardAction take(const UsbControlDone& done, Now now);
  CardAction take(const UsbBulkStopped&, Now now);
  CardAction take(const UsbLost& lost, Now now);
  CardAction take(const CardScans& scans, Now now);
  CardAction take(const CardOutOfStep& out, Now now);
  CardAction take(const CardRestarted& restarted, Now now);
  CardAction take(const CardBulkFailed& failed, Now now);

  void load(const quad08::Sequence& sequence);
  void enter(CardState state);
  void enter_setting_up();
  CardAction next_step(Now now);
  CardAction stage_done(Now now);
  CardAction send(const usb::Setup& setup, Now now);
  [[nodiscard]] std::optional<CardAction> send_again(const UsbControlDone& done, Now now);
  CardAction set_up_again(Now now, const std::string& seen = {});
  CardAction refused_step(const quad08::Step& step, const UsbControlDone& done, Now now);
  CardAction on_status(quad08::Status status, Now now);
  /// True if no scans have arrived since the latest restart of the scan.
  [[nodiscard]] bool recovering() const { return planned_.is_set(Plan::Retry); }
  CardAction open(Now now);
  CardAction halt_soon(Now now);
  CardAction halt(Now now);
  CardAction restart_scan(Now now, std::string text);
  CardAction fail(Now now, std::string text);
  void report(std::string text);

  CounterCardSessionOptions options_;
  CardState state_ = CardState::Closed;
  std::vector<quad08::Step> steps_;
  std::size_t step_ = 0;
  bool asked_ = false;  ///< a control transfer is pending
  bool stopping_bulk_ = false;
  /// the scan must be halted as soon as the pending control transfer is answered
  bool halt_ = false;
  bool scans_since_fault_ = false;
  bool set_up_ = false;  ///< this session or an earlier run has set the counters up
  std::string serial_;   ///< serial number of the card whose counters were set up
  /// The card was opened with counters set up before; no scan has confirmed yet that they continue.
  bool resuming_ = false;
  bool resumed_again_ = false;  ///< the scan was restarted once because it was out of step
  unsigned status_tries_ = 0;
  unsigned tries_ = 0;  ///< number of attempts for the pending control transfer
  Deadlines<Input::Scans> awaited_;
  Deadlines<Plan::Status> planned_;
  Fault fault_;
  std::uint64_t restarts_ = 0;
};

}  // namespace abbe::drivers

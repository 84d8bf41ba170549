#pragma once
/// What is to be said to a counter card, and when: open and self-test, counter set-up, scan start,
/// status poll, restart after an overrun, open again after it was unplugged. To set a counter up
/// zeroes it: after opening again the scan is started without, and only if the card does not go on
/// counting its clock is it set up. Sans-I/O: inputs and a time in, one action out; after each
/// input ask again with CardTick until nothing is to be done. Ordinary world. One thread.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "abbe/drivers/counter_card/wiring.hpp"
#include "abbe/drivers/usb/usb_link.hpp"
#include "abbe/protocol/quad08/sequences.hpp"

namespace abbe::drivers {

struct CounterCardSessionOptions {
  std::string peer = "counter card";  ///< begins every message
  CounterCardWiring wiring;
  UsbBulkStream stream;
  std::chrono::nanoseconds open_timeout = std::chrono::seconds{2};
  std::chrono::nanoseconds control_timeout = std::chrono::milliseconds{500};
  std::chrono::nanoseconds silence = std::chrono::milliseconds{
      90};  ///< no scans for so long is a fault, seen before 100 ms are over
  std::chrono::nanoseconds status_period = std::chrono::milliseconds{100};
  std::chrono::nanoseconds reopen_after = std::chrono::milliseconds{250};
  /// after a restart that brought no scans
  std::chrono::nanoseconds retry_after = std::chrono::milliseconds{500};
  unsigned control_tries =
      3;  ///< of a request the card refuses or that fails, before the device is closed
  /// The card of this serial number was set up by an earlier run of the program: its counters are
  /// set up only if they do not go on.
  std::optional<std::string> set_up_serial;
};

// Inputs.
struct CardTick {
  /// Whatever came before this instant was handed over: only what is overdue then is missing. A
  /// host that was held up looks first.
  protocol::HostTime read_until = protocol::HostTime::max();
};
struct CardScans {
  std::size_t count = 0;
};
struct CardOutOfStep {
  std::string seen;
};
/// The clock channel did not go on from where it was: another session of the card.
struct CardRestarted {
  std::string seen;  ///< how that showed; may be empty
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
  SettingUp,  ///< counters; zeroes them. Left out while they may still count
  Loading,    ///< stops what ran, loads scan list and pacer
  Arming,     ///< data transfer on, list started, until the card is ready
  Streaming,
  Halting,  ///< on the way from Streaming to Loading
};
/// A literal, for DeviceStatus.
[[nodiscard]] const char* name_of(CardState state) noexcept;

class CounterCardSession {
 public:
  explicit CounterCardSession(const CounterCardSessionOptions& options);

  [[nodiscard]] CardAction on(const CardInput& input, protocol::HostTime now);
  /// When a CardTick has something to do.
  [[nodiscard]] protocol::HostTime deadline() const;

  [[nodiscard]] CardState state() const { return state_; }
  /// The device is there, is the right one and has passed its test.
  [[nodiscard]] bool connected() const { return state_ > CardState::Testing; }

  /// A control transfer is under way.
  [[nodiscard]] bool asking() const { return asked_; }

  struct Fault {
    std::uint64_t count = 0;
    std::string text;  ///< of the latest
  };
  [[nodiscard]] const Fault& fault() const { return fault_; }
  /// Times the scan was started anew.
  [[nodiscard]] std::uint64_t restarts() const { return restarts_; }

 private:
  using Now = protocol::HostTime;
  CardAction take(const CardTick& tick, Now now);
  CardAction take(const UsbOpened& opened, Now now);
  CardAction take(const UsbControlDone& done, Now now);
  CardAction take(const UsbBulkStopped&, Now now);
  CardAction take(const UsbLost& lost, Now now);
  CardAction take(const CardScans& scans, Now now);
  CardAction take(const CardOutOfStep& out, Now now);
  CardAction take(const CardRestarted& anew, Now now);
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
  [[nodiscard]] bool expects_scans() const;
  [[nodiscard]] bool silent(Now until) const;
  CardAction trouble_of_silence(Now now);
  CardAction watch(Now now);
  CardAction halt(Now now);
  CardAction trouble(Now now, std::string text);
  CardAction fail(Now now, std::string text);
  void report(std::string text);

  CounterCardSessionOptions options_;
  CardState state_ = CardState::Closed;
  std::vector<quad08::Step> steps_;
  std::size_t step_ = 0;
  bool asked_ = false;  ///< a control transfer is under way
  bool stopping_bulk_ = false;
  bool halt_ = false;      ///< as soon as the control transfer under way is answered
  bool troubled_ = false;  ///< restarted, and no scans since: not again before retry_at_
  bool scans_since_fault_ = false;
  bool set_up_ = false;  ///< the counters were, by this session or an earlier run
  std::string serial_;   ///< of the card that was set up
  /// scans are expected from counters that were set up before the card was opened
  bool resuming_ = false;
  bool resumed_again_ = false;  ///< these were out of step once, and the scan was started anew
  unsigned status_tries_ = 0;
  unsigned tries_ = 0;  ///< of the control transfer under way
  Now open_at_{};
  Now asked_at_{};
  Now last_scans_{};
  Now next_status_{};
  Now retry_at_{};
  Fault fault_;
  std::uint64_t restarts_ = 0;
};

}  // namespace abbe::drivers

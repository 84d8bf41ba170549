#include "abbe/drivers/counter_card/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace abbe::drivers {
namespace {

using protocol::HostTime;

constexpr unsigned kMostStatusTries = 100;  // same value as in the manufacturer's library

std::string in_milliseconds(std::chrono::nanoseconds d) {
  return fmt::format("{} ms", std::chrono::duration_cast<std::chrono::milliseconds>(d).count());
}

quad08::CounterSetup setup_of(const CounterAxis& axis) {
  return {.mode = quad08::CounterMode::Encoder,
          .quadrature = quad08::Quadrature::X4,
          .latch_on_index = axis.latch_on_index};
}

}  // namespace

const char* name_of(CardState state) noexcept {
  switch (state) {
    case CardState::Closed:
      return "closed";
    case CardState::Opening:
      return "opening";
    case CardState::Testing:
      return "testing";
    case CardState::SettingUp:
      return "setting up";
    case CardState::Loading:
      return "loading";
    case CardState::Arming:
      return "arming";
    case CardState::Streaming:
      return "streaming";
    case CardState::Halting:
      return "restarting";
  }

  return "?";
}

CounterCardSession::CounterCardSession(const CounterCardSessionOptions& options)
    : options_(options),
      set_up_(options.set_up_serial.has_value()),
      serial_(options.set_up_serial.value_or("")) {
  planned_.set(Plan::Open, {});
}

CardAction CounterCardSession::on(const CardInput& input, HostTime now) {
  return std::visit([&](const auto& i) { return take(i, now); }, input);
}

/// Plans that wait although they may be due: a request while another one is pending, and a restart
/// of the scan outside Streaming, where a restart is already in progress.
std::span<const CounterCardSession::Plan> CounterCardSession::waiting() const {
  if (asked_ || stopping_bulk_) return kAfterAnswer;
  const bool streaming = state_ == CardState::Streaming && !halt_;
  return streaming ? std::span<const Plan>{} : std::span<const Plan>{kWhileStreaming};
}

CardAction CounterCardSession::take(const CardTick& tick, HostTime now) {
  const auto missing = awaited_.passed(std::min(now, tick.read_until));
  if (missing) return is_missing(*missing, now);
  const auto plan = planned_.passed(now, waiting());
  if (!plan) return CardNothing{};

  switch (*plan) {
    case Plan::Open:
      return open(now);
    case Plan::Step:
      planned_.cancel(Plan::Step);
      return state_ == CardState::Streaming ? halt(now) : next_step(now);
    case Plan::Retry:
      return restart_scan(now, {});
    case Plan::Status:
      planned_.set(Plan::Status, now + options_.status_period);
      return send(quad08::read(quad08::Register::Acquisition), now);
  }

  return CardNothing{};
}

CardAction CounterCardSession::is_missing(Input input, HostTime now) {
  switch (input) {
    case Input::Opened:
      return fail(now,
                  fmt::format("open: no answer in {}", in_milliseconds(options_.open_timeout)));
    case Input::ControlDone:
    case Input::BulkStopped:
      return fail(
          now, fmt::format("request: no answer in {}", in_milliseconds(options_.control_timeout)));
    // this also applies while a status request is pending, because a failed card does not answer it
    case Input::Scans:
      return restart_scan(now, fmt::format("no scans for {}", in_milliseconds(options_.silence)));
  }

  return CardNothing{};
}

CardAction CounterCardSession::open(HostTime now) {
  enter(CardState::Opening);
  planned_.cancel(Plan::Open);
  awaited_.set(Input::Opened, now + options_.open_timeout);
  return CardOpen{};
}

/// Halts the scan as soon as no control transfer is pending.
CardAction CounterCardSession::halt_soon(HostTime now) {
  halt_ = true;
  awaited_.cancel(Input::Scans);
  planned_.cancel(Plan::Status);
  planned_.set(Plan::Step, now);
  return asked_ ? CardAction{CardNothing{}} : halt(now);
}

CardAction CounterCardSession::halt(HostTime now) {
  halt_ = false;
  planned_.cancel(Plan::Step);
  enter(CardState::Halting);
  load(quad08::stop_sequence());
  return next_step(now);
}

CardAction CounterCardSession::take(const UsbOpened& opened, HostTime now) {
  if (state_ != CardState::Opening) return CardNothing{};
  awaited_.cancel(Input::Opened);
  if (set_up_ && opened.serial != serial_) {
    set_up_ = false;
    report(
        fmt::format("{}: its serial number is \"{}\", the card set up before is \"{}\": its "
                    "counters restart at 0",
                    options_.peer, opened.serial, serial_));
  }
  serial_ = opened.serial;
  enter(CardState::Testing);
  load(quad08::open_sequence());
  return next_step(now);
}

void CounterCardSession::enter(CardState state) {
  state_ = state;
  step_ = 0;
  steps_.clear();
  status_tries_ = 0;
}

void CounterCardSession::load(const quad08::Sequence& sequence) {
  const auto steps = sequence.steps();
  steps_.insert(steps_.end(), steps.begin(), steps.end());
}

CardAction CounterCardSession::next_step(HostTime now) {
  if (step_ < steps_.size()) return send(steps_[step_].setup, now);
  return stage_done(now);
}

CardAction CounterCardSession::send(const usb::Setup& setup, HostTime now) {
  asked_ = true;
  awaited_.set(Input::ControlDone, now + options_.control_timeout);
  tries_ = 1;
  return CardControl{setup};
}

/// A failed or refused transfer is repeated, up to control_tries: a single failure does not
/// indicate a defective card. A request with a wrong answer is not repeated.
std::optional<CardAction> CounterCardSession::send_again(const UsbControlDone& done, HostTime now) {
  if (done.outcome == UsbOutcome::Done || tries_ >= options_.control_tries) return std::nullopt;
  const unsigned tries = tries_ + 1;
  CardAction again = send(done.setup, now);
  tries_ = tries;
  return again;
}

CardAction CounterCardSession::stage_done(HostTime now) {
  switch (state_) {
    case CardState::Testing:
      resuming_ = set_up_;
      resumed_again_ = false;
      if (!set_up_) {
        enter_setting_up();
        return next_step(now);
      }
      [[fallthrough]];
    case CardState::SettingUp:
      set_up_ = true;
      enter(CardState::Loading);
      load(quad08::load_sequence(layout_of(options_.wiring), divisor_of(options_.wiring)));
      return next_step(now);
    case CardState::Loading:
      enter(CardState::Arming);
      load(quad08::arm_sequence());
      planned_.set(Plan::Step, now);
      return CardStartBulk{};
    case CardState::Arming:
      return send(quad08::read(quad08::Register::Acquisition), now);
    case CardState::Halting:
      stopping_bulk_ = true;
      awaited_.set(Input::BulkStopped, now + options_.control_timeout);
      return CardStopBulk{};
    case CardState::Closed:
    case CardState::Opening:
    case CardState::Streaming:
      break;
  }

  return CardNothing{};
}

/// Begins the set-up of the counters. With the card's own timer as the clock, the timer is stopped
/// meanwhile: all counters then start with it, from a common zero.
void CounterCardSession::enter_setting_up() {
  enter(CardState::SettingUp);
  const auto& wiring = options_.wiring;
  const auto timer =
      wiring.clock_source == ClockSource::Timer1 ? quad08::Timer::Timer1 : quad08::Timer::Timer0;
  const bool own_clock = wiring.clock_source != ClockSource::External;

  const auto set_up = [this](std::uint8_t channel, const quad08::CounterSetup& setup,
                             const quad08::Debounce& phases, const quad08::Debounce& index) {
    for (const auto& write : quad08::channel_writes(channel, setup, phases, index))
      steps_.push_back({write, quad08::Expect::Nothing, 0});
  };

  if (own_clock) load(quad08::timer_stop(timer));
  for (const auto& axis : wiring.axes)
    set_up(axis.channel, setup_of(axis), axis.debounce, axis.debounce);
  if (wiring.edge_channel) set_up(*wiring.edge_channel, {}, wiring.edge_debounce, {});

  if (wiring.latch_channel) {
    set_up(*wiring.latch_channel, {.latch_on_index = true}, {}, wiring.latch_debounce);
  }

  set_up(wiring.clock_channel, {}, {}, {});
  if (own_clock) load(quad08::timer_start(timer, timer_divisor(wiring)));
}

CardAction CounterCardSession::take(const UsbControlDone& done, HostTime now) {
  if (!asked_) return CardNothing{};
  asked_ = false;
  awaited_.cancel(Input::ControlDone);
  if (auto again = send_again(done, now)) return *again;

  if (step_ < steps_.size()) {
    const auto& step = steps_[step_];
    const auto word = quad08::decode_word(done.bytes());
    const bool answered =
        done.outcome == UsbOutcome::Done && (step.expect == quad08::Expect::Nothing || word);
    if (!answered || !fulfilled(step, word.value_or(0))) return refused_step(step, done, now);
    ++step_;
    return next_step(now);
  }

  if (state_ == CardState::Arming && done.setup == quad08::start_pacer()) {
    enter(CardState::Streaming);
    planned_.set(Plan::Status, now + options_.status_period);
    if (recovering()) {
      planned_.set(Plan::Retry, now + options_.retry_after);
    } else {
      awaited_.set(Input::Scans, now + options_.silence);
    }
    return CardNothing{};
  }

  const auto word = quad08::decode_word(done.bytes());
  if (done.outcome != UsbOutcome::Done || !word) return fail(now, "status: it cannot be read");
  return on_status(quad08::Status{*word}, now);
}

CardAction CounterCardSession::refused_step(const quad08::Step& step, const UsbControlDone& done,
                                            HostTime now) {
  const auto word = quad08::decode_word(done.bytes());
  const auto what = step.setup == quad08::read_firmware_version()
                        ? std::string{"firmware version"}
                        : fmt::format("register {:02X}h", step.setup.index);
  if (done.outcome != UsbOutcome::Done) return fail(now, what + ": refused by the device");
  if (!word) return fail(now, fmt::format("{}: {} bytes instead of 2", what, done.length));
  return fail(
      now, fmt::format("self-test: {} reads {:04X}h, {:04X}h expected", what, *word, step.value));
}

CardAction CounterCardSession::on_status(quad08::Status status, HostTime now) {
  if (state_ == CardState::Streaming) {
    if (status.overrun())
      return restart_scan(now, fmt::format("overrun (status {:03X}h)", status.bits));
    if (status.hardware_error())
      return restart_scan(now, fmt::format("hardware error (status {:03X}h)", status.bits));
    return CardNothing{};
  }

  if (state_ != CardState::Arming) return CardNothing{};
  if (status.hardware_error())
    return fail(now, fmt::format("scan start: hardware error (status {:03X}h)", status.bits));
  if (status.ready()) return send(quad08::start_pacer(), now);
  if (++status_tries_ >= kMostStatusTries)
    return fail(now, fmt::format("scan start: not ready (status {:03X}h)", status.bits));

  return send(quad08::read(quad08::Register::Acquisition), now);
}

CardAction CounterCardSession::take(const UsbBulkStopped&, HostTime now) {
  if (state_ != CardState::Halting) return CardNothing{};
  stopping_bulk_ = false;
  awaited_.cancel(Input::BulkStopped);
  if (!set_up_) {
    enter_setting_up();
    return next_step(now);
  }
  enter(CardState::Loading);
  load(quad08::load_sequence(layout_of(options_.wiring), divisor_of(options_.wiring)));
  return next_step(now);
}

CardAction CounterCardSession::take(const UsbLost& lost, HostTime now) {
  if (state_ == CardState::Closed) return CardNothing{};
  report(lost.error.text);
  fail(now, {});
  return CardNothing{};
}

CardAction CounterCardSession::take(const CardScans& scans, HostTime now) {
  if (scans.count == 0) return CardNothing{};
  planned_.cancel(Plan::Retry);
  if (state_ == CardState::Streaming && !halt_) awaited_.set(Input::Scans, now + options_.silence);
  resuming_ = false;
  scans_since_fault_ = true;
  return CardNothing{};
}

CardAction CounterCardSession::take(const CardRestarted& restarted, HostTime now) {
  return state_ == CardState::Streaming && !halt_ ? set_up_again(now, restarted.seen)
                                                  : CardAction{CardNothing{}};
}

/// Sets the counters up, because they have not continued: the card lost its power, or another
/// program has used it.
CardAction CounterCardSession::set_up_again(HostTime now, const std::string& seen) {
  report(fmt::format("{}: its counters did not continue{}{}: they are set up and restart at 0",
                     options_.peer, seen.empty() ? "" : ", ", seen));
  set_up_ = resuming_ = false;
  planned_.cancel(Plan::Retry);
  return halt_soon(now);
}

/// A stream that is shifted by some bytes also looks like a stopped clock, because another counter
/// is read in the clock's place. Therefore the scan is restarted once before the counters are set
/// up again.
CardAction CounterCardSession::take(const CardOutOfStep& out, HostTime now) {
  if (state_ != CardState::Streaming || halt_) return CardNothing{};
  if (resuming_ && std::exchange(resumed_again_, true)) return set_up_again(now);
  return restart_scan(now, out.seen);
}

CardAction CounterCardSession::take(const CardBulkFailed& failed, HostTime now) {
  if (state_ != CardState::Streaming || halt_) return CardNothing{};
  return restart_scan(now, failed.outcome == UsbOutcome::Stalled
                               ? "scan endpoint: stalled"
                               : "scan endpoint: transfer failed");
}

/// Restarts the scan; the counters continue. Further faults before the next scan are not reported:
/// they belong to the same fault.
CardAction CounterCardSession::restart_scan(HostTime now, std::string text) {
  if (planned_.ahead(Plan::Retry, now)) return CardNothing{};
  if (!recovering()) report(fmt::format("{}: {}", options_.peer, text));
  planned_.set(Plan::Retry, now + options_.retry_after);
  ++restarts_;
  return halt_soon(now);
}

CardAction CounterCardSession::fail(HostTime now, std::string text) {
  if (!text.empty()) report(fmt::format("{}: {}", options_.peer, text));
  enter(CardState::Closed);
  asked_ = stopping_bulk_ = halt_ = resuming_ = false;
  awaited_.cancel_all();
  planned_.cancel_all();
  planned_.set(Plan::Open, now + options_.reopen_after);
  return CardClose{};
}

/// Reports a fault. The same text again without a scan in between is not a new fault: the card is
/// still missing.
void CounterCardSession::report(std::string text) {
  if (!std::exchange(scans_since_fault_, false) && text == fault_.text) return;
  ++fault_.count;
  fault_.text = std::move(text);
}

}  // namespace abbe::drivers

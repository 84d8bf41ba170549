#include "abbe/drivers/counter_card/device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/protocol/usbip/urb.hpp"
#include "abbe/result/try.hpp"

namespace abbe::drivers {
namespace {

using protocol::RawBlock;

constexpr std::size_t kMostTransferBytes = 16384;  // same value as in the manufacturer's library

CounterCardOptions completed(const CounterCardOptions& options, const UsbLink& link) {
  CounterCardOptions all = options;
  all.session.peer = fmt::format("{} ({})", options.name, link.name());
  all.session.wiring = options.receiver.wiring;
  all.session.stream = {transfer_bytes(options), options.transfers_in_flight};
  return all;
}

std::string seconds_text(double behind_s) {
  return fmt::format("its clock channel is {:.3f} s {} its expected count", std::abs(behind_s),
                     behind_s < 0.0 ? "ahead of" : "behind");
}

Result<void> check(const CounterCardOptions& options) {
  const auto refuse = [&](const char* what) {
    return tl::unexpected{
        Error{ErrorCode::BadConfiguration, fmt::format("{}: {}", options.name, what)}};
  };
  ABBE_TRY(check(options.receiver.wiring));
  if (options.transfer_time.count() <= 0)
    return refuse("the duration of a transfer must be positive");
  if (options.transfers_in_flight < 2) return refuse("at least 2 transfers must be in flight");
  if (options.sample_every == 0) return refuse("one sample for every 0 scans is not possible");
  return {};
}

}  // namespace

UsbIdentity identity_of(const CounterCardOptions& options) {
  return {.vendor = quad08::kVendor,
          .product = quad08::kProduct,
          .serial = options.serial,
          .configuration = quad08::kConfiguration,
          .bulk_endpoint = quad08::kScanEndpoint};
}

std::size_t transfer_bytes(const CounterCardOptions& options) {
  const auto& wiring = options.receiver.wiring;
  const double bytes = std::chrono::duration<double>(options.transfer_time).count() *
                       scan_rate_hz(wiring) * static_cast<double>(layout_of(wiring).scan_bytes());
  const double most = static_cast<double>(kMostTransferBytes);
  const auto packets =
      (static_cast<std::size_t>(std::clamp(bytes, 1.0, most)) + quad08::kPacketSize - 1) /
      quad08::kPacketSize;
  return packets * quad08::kPacketSize;
}

Result<std::unique_ptr<CounterCardDevice>> CounterCardDevice::create(
    const CounterCardOptions& options, std::unique_ptr<UsbLink> link, const TimeSource& time,
    CounterScanSink* sink) {
  if (const auto ok = check(options); !ok) return tl::unexpected{ok.error()};
  const auto all = completed(options, *link);
  return std::unique_ptr<CounterCardDevice>{
      new CounterCardDevice{all, std::move(link), time, sink}};
}

CounterCardDevice::CounterCardDevice(const CounterCardOptions& options,
                                     std::unique_ptr<UsbLink> link, const TimeSource& time,
                                     CounterScanSink* sink)
    : options_(options),
      link_(std::move(link)),
      time_(time),
      sink_(sink),
      live_axes_(!std::ranges::all_of(options.receiver.wiring.axes, &CounterAxis::latch_on_index)),
      decimation_(options.sample_every),
      samples_(options.sample_capacity),
      raw_(options.raw_capacity_blocks),
      receiver_(options.receiver),
      session_(options.session) {
  show();
}

CounterCardDevice::~CounterCardDevice() {
  try {
    if (session_.state() == CardState::Streaming) stop_scan();
  } catch (...) {  // NOLINT(bugprone-empty-catch): out of memory; the next open stops the scan
  }
}

void CounterCardDevice::stop_scan() {
  if (session_.asking() && !answered()) return;
  const auto sequence = quad08::stop_sequence();
  for (const auto& step : sequence.steps()) {
    send(step.setup);
    if (!answered()) return;
  }
}

bool CounterCardDevice::answered() {
  constexpr std::chrono::milliseconds kPatience{10};
  constexpr int kMostWaits = 10;  // scans arrive in between
  for (int i = 0; i < kMostWaits; ++i) {
    for (const auto& event : link_->wait(time_.wall(kPatience))) {
      if (std::holds_alternative<UsbControlDone>(event)) return true;
      if (std::holds_alternative<UsbLost>(event)) return false;
    }
  }
  return false;
}

DeviceStatus CounterCardDevice::status() const {
  return board_.read(options_.name, samples_.dropped(), raw_.dropped());
}

std::string CounterCardDevice::assumption() const {
  if (!rests_on_assumption(options_.receiver.wiring)) return {};
  return options_.name +
         ": assumes that a latched counter delivers, in a scan, its count at the latest index "
         "edge; not yet verified on hardware";
}

void CounterCardDevice::wait(std::chrono::nanoseconds at_most) {
  hand_over_scans();
  hand_over_events();
  step_session(CardTick{read_until_});
  read_until_ = time_.now();
  const auto until_due = session_.deadline() - read_until_;
  events_ = link_->wait(time_.wall(std::clamp(until_due, std::chrono::nanoseconds{0}, at_most)));
  cycle_end_ = time_.now();
  account();
  show();
}

/// Passes the results of the latest receive() to the session.
void CounterCardDevice::hand_over_scans() {
  const auto restarts = receiver_.counters().restarted;
  if (restarts != std::exchange(restarts_seen_, restarts))
    step_session(CardRestarted{seconds_text(receiver_.behind_s())});
  if (const auto count = std::exchange(scans_, 0); count != 0) step_session(CardScans{count});
  if (!receiver_.out_of_step()) {
    out_of_step_reported_ = false;
  } else if (!std::exchange(out_of_step_reported_, true)) {
    step_session(CardOutOfStep{
        fmt::format("scans out of step: clock channel {} counted {} in one scan, {:.1f} expected",
                    options_.receiver.wiring.clock_channel, receiver_.refused_step(),
                    receiver_.expected_step())});
  }
}

void CounterCardDevice::hand_over_events() {
  for (const auto& event : std::exchange(events_, {})) {
    if (const auto* bulk = std::get_if<UsbBulkIn>(&event)) {
      if (bulk->outcome != UsbOutcome::Done) step_session(CardBulkFailed{bulk->outcome});
    } else if (const auto* done = std::get_if<UsbControlDone>(&event)) {
      step_session(*done);
    } else if (const auto* lost = std::get_if<UsbLost>(&event)) {
      if (session_.connected()) raw_.push_bytes(cycle_end_, RawBlock::Direction::ToDevice, {});
      step_session(*lost);
    } else if (const auto* opened = std::get_if<UsbOpened>(&event)) {
      raw_.push_bytes(cycle_end_, RawBlock::Direction::FromDevice, {});
      progress_.set_serial_number(opened->serial);
      step_session(*opened);
    } else {
      step_session(UsbBulkStopped{});
    }
  }
}

void CounterCardDevice::step_session(const CardInput& input) {
  // If the card does not answer an action (start of the bulk transfers), the session gives the next
  // action at once.
  for (bool again = act(session_.on(input, time_.now())); again;)
    again = act(session_.on(CardTick{read_until_}, time_.now()));
}

bool CounterCardDevice::act(const CardAction& action) {
  if (std::holds_alternative<CardOpen>(action)) link_->open();
  if (std::holds_alternative<CardClose>(action)) link_->close();
  if (const auto* control = std::get_if<CardControl>(&action)) send(control->setup);
  if (std::holds_alternative<CardStopBulk>(action)) link_->stop_bulk_in();
  if (!std::holds_alternative<CardStartBulk>(action)) return false;
  link_->start_bulk_in(options_.session.stream);
  return true;
}

void CounterCardDevice::send(const usb::Setup& setup) {
  protocol::usbip::Submit request;
  request.head.sequence = ++raw_sequence_;
  request.head.direction =
      setup.device_to_host() ? protocol::usbip::Direction::In : protocol::usbip::Direction::Out;
  request.length = setup.length;
  request.setup = usb::encode(setup);
  raw_.push_bytes(time_.now(), RawBlock::Direction::ToDevice,
                  protocol::usbip::encode(protocol::usbip::Urb{request}));
  receiver_.on_control(setup);
  link_->control(setup);
}

void CounterCardDevice::report_clock() {
  const double skew = receiver_.skew_beyond_limit();
  if (std::exchange(clock_reported_, skew != 0.0) || skew == 0.0) return;
  constexpr double kPpm = 1e6;
  board_.fault(
      cycle_end_,
      fmt::format("{}: the clock of channel {} runs {:.0f} ppm {}, the limit is {:.0f} ppm: "
                  "scans are marked ClockUnsettled; check the clock and clock_MHz",
                  options_.session.peer, options_.receiver.wiring.clock_channel,
                  kPpm * std::abs(skew), skew > 0.0 ? "fast" : "slow",
                  kPpm * options_.receiver.clock.max_skew));
}

void CounterCardDevice::account() {
  report_clock();
  const auto disagreements = receiver_.counters().latch_disagreements;
  if (disagreements != std::exchange(disagreements_seen_, disagreements)) {
    board_.fault(
        cycle_end_,
        fmt::format("{}: latch channel {} does not count the clock of channel {}",
                    options_.session.peer, options_.receiver.wiring.latch_channel.value_or(0),
                    options_.receiver.wiring.clock_channel));
  }
  if (faults_seen_ == session_.fault().count) return;
  faults_seen_ = session_.fault().count;
  board_.fault(cycle_end_, session_.fault().text);
}

void CounterCardDevice::show() {
  board_.set_state(name_of(session_.state()));
  board_.set_connected(session_.connected());
}

}  // namespace abbe::drivers

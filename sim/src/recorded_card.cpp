#include "abbe/sim/recorded_card.hpp"

#include <algorithm>
#include <utility>

#include "abbe/protocol/quad08/sequences.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;
using Outcome = ControlAnswer::Outcome;

constexpr auto kStatus = quad08::read(quad08::Register::Acquisition);

bool is_vendor(const usb::Setup& setup) {
  return (setup.request_type & 0x60u) == 0x40u;
}

}  // namespace

RecordedCard::RecordedCard(const RecordedDevice& device, const std::string& serial,
                           ReplayTimeline& timeline, bool leads)
    : timeline_(timeline), leads_(leads), descriptors_({.serial = serial, .channels = {}}) {
  for (const RecordedBlock& block : device.blocks) read(block);
  if (connections_.empty()) connections_.emplace_back();
  find_halts();
}

void RecordedCard::read(const RecordedBlock& block) {
  if (block.lost()) {
    if (!connections_.empty()) connections_.back().lost = block.time;
    return;
  }
  if (block.connects()) versions_ = 0;
  if (block.bytes.size() >= protocol::usbip::kUrbHeaderSize)
    read_message(block.bytes, block.time, block.to_device);
}

void RecordedCard::read_message(std::span<const std::byte> message, HostTime time, bool to_device) {
  constexpr auto kHead = protocol::usbip::kUrbHeaderSize;
  const auto urb = protocol::usbip::decode_urb(message.first<kHead>());
  const auto* request = urb ? std::get_if<protocol::usbip::Submit>(&*urb) : nullptr;
  const auto* reply = urb ? std::get_if<protocol::usbip::SubmitReply>(&*urb) : nullptr;
  if (to_device && request != nullptr) read_request(usb::decode_setup(request->setup), time);
  if (to_device || reply == nullptr) return;
  const auto data = message.subspan(kHead);

  if (reply->head.endpoint != 0) {
    if (!scans_.empty()) scans_.back().transfers.push_back({time, {data.begin(), data.end()}});
  } else if (!exchanges_.empty() && !exchanges_.back().answer) {
    const bool done = reply->status == protocol::usbip::UrbStatus::Ok;
    exchanges_.back().answer =
        ControlAnswer{done ? Outcome::Done : Outcome::Stalled, {data.begin(), data.end()}};
  }
}

void RecordedCard::read_request(const usb::Setup& setup, HostTime time) {
  // A host begins a connection with two requests for the firmware version.
  const bool version = setup == quad08::read_firmware_version();
  const bool opens = version && (versions_ == 0 || versions_ == 2);
  if (opens || connections_.empty())
    connections_.push_back({.begins = exchanges_.size(), .lost = {}});
  if (version) versions_ = opens ? 1 : versions_ + 1;
  if (setup == quad08::start_pacer())
    scans_.push_back({.begins = exchanges_.size(), .transfers = {}});
  exchanges_.push_back({setup, time, {}});
}

void RecordedCard::find_halts() {
  for (Scan& scan : scans_) {
    scan.halts = scan.begins + 1;
    while (scan.halts < exchanges_.size() && exchanges_[scan.halts].setup == kStatus) ++scan.halts;
  }
}

UsbIds RecordedCard::ids() const {
  return {descriptors_.options().vendor, descriptors_.options().product};
}

std::size_t RecordedCard::transfers() const {
  std::size_t sum = 0;
  for (const Scan& scan : scans_) sum += scan.transfers.size();
  return sum;
}

// --- requests

std::size_t RecordedCard::end_of_connection() const {
  const std::size_t after = connection_.value_or(0) + 1;
  return after < connections_.size() ? connections_[after].begins : exchanges_.size();
}

ControlAnswer RecordedCard::answer(const usb::Setup& setup, HostTime now) {
  if (!is_vendor(setup)) return descriptors_.answer(setup, now);
  if (setup == quad08::read_firmware_version() && !std::exchange(opened_, true)) open();
  if (running_ && setup == kStatus) return status_at(recorded(now));
  if (std::exchange(running_, false)) {
    resuming_ = halts_early(now);
    flushing_ = !resuming_;
  }
  return resuming_ ? unrecorded(setup, now) : next_answer(setup, now);
}

/// Selects the next recorded connection. After the last one, the first follows again.
void RecordedCard::open() {
  connection_ = connection_ ? (*connection_ + 1) % connections_.size() : 0;
  next_ = connections_[*connection_].begins;
  const auto first = std::ranges::find_if(scans_, [&](const Scan& s) { return s.begins >= next_; });
  if (first != scans_.end() && *connection_ == 0) {
    scan_.reset();
    if (leads_) timeline_.rewind();
  }
  next_transfer_ = 0;
  resuming_ = false;
}

/// The answer to the latest status request that was recorded before this recorded time.
ControlAnswer RecordedCard::status_at(HostTime recorded) const {
  constexpr std::byte kListRuns{quad08::Status::kPipeFull};
  const Scan& scan = scans_[*scan_];
  ControlAnswer status{Outcome::Done, {kListRuns, std::byte{0}}};
  for (std::size_t i = scan.begins + 1; i < scan.halts && exchanges_[i].asked <= recorded; ++i)
    status = exchanges_[i].answer.value_or(ControlAnswer{Outcome::Silent, {}});
  return status;
}

std::optional<std::size_t> RecordedCard::find(const usb::Setup& setup) const {
  for (std::size_t i = next_; i < end_of_connection(); ++i)
    if (exchanges_[i].setup == setup) return i;
  return std::nullopt;
}

ControlAnswer RecordedCard::next_answer(const usb::Setup& setup, HostTime now) {
  const auto found = find(setup);
  if (!found) return unrecorded(setup, now);
  next_ = *found + 1;
  const auto& recorded = exchanges_[*found].answer;
  if (!recorded) return {Outcome::Silent, {}};
  if (setup != quad08::start_pacer()) return *recorded;
  const auto begun = std::ranges::find(scans_, *found, &Scan::begins);
  start(static_cast<std::size_t>(begun - scans_.begin()), now);
  return *recorded;
}

/// The answer to a request that is not in the recording. If the recorded card left a later request
/// of this connection unanswered, there is no answer either (the last connection excepted); else
/// the card accepts the request.
ControlAnswer RecordedCard::unrecorded(const usb::Setup& setup, HostTime now) {
  const auto end = exchanges_.begin() + static_cast<std::ptrdiff_t>(end_of_connection());
  const auto from = std::min(exchanges_.begin() + static_cast<std::ptrdiff_t>(next_), end);
  const bool last = end == exchanges_.end();
  const bool silent = !last && std::any_of(from, end, [](const Exchange& e) { return !e.answer; });
  if (!resuming_ && silent) return {Outcome::Silent, {}};

  if (resuming_ && setup == quad08::start_pacer()) {
    resuming_ = false;
    running_ = true;
    shift_ = now - scans_[*scan_].transfers[next_transfer_].time;
  }

  ControlAnswer answer;
  if (setup == kStatus) answer.data = {std::byte{quad08::Status::kPipeFull}, std::byte{0}};
  if (setup != kStatus && setup.device_to_host()) answer.data.resize(setup.length);

  return answer;
}

// --- scans

void RecordedCard::start(std::size_t scan, HostTime now) {
  scan_ = scan;
  next_transfer_ = 0;
  running_ = true;
  flushing_ = false;
  const HostTime began = exchanges_[scans_[scan].begins].asked;
  shift_ = now - began;
  if (leads_) timeline_.start(began, now);
}

HostTime RecordedCard::due(HostTime recorded) const {
  return !leads_ && timeline_.running() ? timeline_.due(recorded) : recorded + shift_;
}
HostTime RecordedCard::recorded(HostTime now) const {
  return !leads_ && timeline_.running() ? timeline_.recorded(now) : now - shift_;
}

bool RecordedCard::has_rest() const {
  return scan_ && next_transfer_ < scans_[*scan_].transfers.size();
}

/// True if the host halts the scan more than kOutOfStep earlier than in the recording: it will then
/// start it again.
bool RecordedCard::halts_early(HostTime now) const {
  if (!has_rest()) return false;
  const Scan& scan = scans_[*scan_];
  if (scan.halts >= exchanges_.size()) return true;
  return exchanges_[scan.halts].asked > recorded(now) + kOutOfStep;
}

bool RecordedCard::scanning() const {
  return has_rest() && (running_ || flushing_);
}

void RecordedCard::advance(HostTime now, std::size_t) {
  if (!scanning()) return;
  const auto& transfers = scans_[*scan_].transfers;
  for (; has_rest() && (flushing_ || due(transfers[next_transfer_].time) <= now);
       ++next_transfer_) {
    const auto& bytes = transfers[next_transfer_].bytes;
    fifo_.insert(fifo_.end(), bytes.begin(), bytes.end());
  }
  finished_ = finished_ || (!has_rest() && *scan_ + 1 == scans_.size());
}

std::vector<std::byte> RecordedCard::take(std::size_t most) {
  const auto end = fifo_.begin() + static_cast<std::ptrdiff_t>(std::min(most, fifo_.size()));
  std::vector<std::byte> bytes(fifo_.begin(), end);
  fifo_.erase(fifo_.begin(), end);
  return bytes;
}

HostTime RecordedCard::available_at(std::size_t bytes) const {
  if (!scanning()) return HostTime::max();
  const auto& transfers = scans_[*scan_].transfers;
  std::size_t sum = fifo_.size();
  for (std::size_t i = next_transfer_; i < transfers.size(); ++i) {
    sum += transfers[i].bytes.size();
    if (sum >= bytes) return flushing_ ? HostTime::min() : due(transfers[i].time);
  }
  return due(transfers.back().time);
}

void RecordedCard::host_disconnected() {
  fifo_.clear();
  opened_ = running_ = flushing_ = resuming_ = false;
}

HostTime RecordedCard::breaks_at() const {
  if (!connection_ || !running_) return HostTime::max();
  const auto& lost = connections_[*connection_].lost;
  return lost ? due(*lost) : HostTime::max();
}

}  // namespace abbe::sim

#include "abbe/messages/dds_bridge.hpp"

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "abbe/messages/cdr.hpp"
#include "retained_payloads.hpp"

namespace abbe::daemon {
namespace {

struct Written {
  bool ever = false;
  DdsBridge::WallTime at{};
};

constexpr const char* kSourceLost = "SOURCE_LOST";

bool is_durable(Topic topic) {
  return traits(topic).kind == TopicTraits::Kind::Durable;
}

/// The ModelState in `payload`, changed to MODEL_INVALID with reason SOURCE_LOST. Empty if
/// `payload` is not a ModelState or already has this reason.
std::vector<std::byte> invalidated(std::span<const std::byte> payload) {
  auto state = decode<v1::ModelState>(payload);
  if (!state || state->reason() == kSourceLost) return {};
  state->state(v1::MODEL_INVALID);
  state->reason(kSourceLost);
  state->sequence_number(state->sequence_number() + 1);
  std::vector<std::byte> invalid;
  if (!encode(*state, invalid)) invalid.clear();
  return invalid;
}

}  // namespace

struct DdsBridge::State {
  explicit State(DdsOutlet& o) : outlet(o) {}

  DdsOutlet& outlet;
  bool alive = false;
  WallTime last_beat{};
  WallTime last_assert{};
  RetainedPayloads<Written> durable;
  /// The slices of ErrorGrid written so far, by machine and slice number: header and key of each.
  std::map<std::string, std::map<std::uint32_t, std::vector<std::byte>>> slices_written;
  std::uint64_t written = 0;
  std::uint64_t refused = 0;
  std::uint64_t outdated = 0;

  [[nodiscard]] bool silent(WallTime now) const { return now - last_beat > kSilence; }

  void write(Topic topic, std::span<const std::byte> payload) {
    ++(outlet.write(topic, payload) ? written : refused);
    if (topic == Topic::ErrorGrid) follow_slices(payload);
  }

  /// Disposes the slices with a number beyond those of the grid that `payload` belongs to. They
  /// belong to another model, perhaps of an earlier abbed, and DDS would retain them for late
  /// joiners.
  void follow_slices(std::span<const std::byte> payload) {
    const auto key = payload_key(Topic::ErrorGrid, payload);
    const auto slices = grid_slices(payload);
    if (!key || !slices) return;
    auto& known = slices_written[std::string{key->machine}];
    for (auto beyond = known.lower_bound(*slices); beyond != known.end();
         beyond = known.erase(beyond))
      outlet.dispose(Topic::ErrorGrid, beyond->second);
    // Disposing needs only the key.
    const std::size_t head = kCdrHeaderBytes + key->bytes.size();
    known[*key->number].assign(payload.begin(),
                               payload.begin() + static_cast<std::ptrdiff_t>(head));
  }

  void write_live(Topic topic, std::span<std::byte> payload, WallTime::duration waited) {
    if (waited > kLongestWait) {
      ++outdated;
    } else if (topic == Topic::Compensation && !add_to_age(payload, waited)) {
      ++refused;
    } else {
      write(topic, payload);
    }
  }

  void write_due_durable(WallTime now) {
    for (auto& entry : durable.entries()) {
      if (entry.extra.ever && now - entry.extra.at < traits(entry.topic).repeat) continue;
      write(entry.topic, entry.payload);
      entry.extra = {true, now};
    }
  }

  /// Writes every retained ModelState once more as invalid and discards it. All other durable
  /// samples are marked to be written again when abbed is alive again.
  void report_source_lost() {
    alive = false;
    for (const auto& entry : durable.entries()) {
      if (entry.topic != Topic::ModelState) continue;
      if (const auto invalid = invalidated(entry.payload); !invalid.empty())
        write(Topic::ModelState, invalid);
    }
    std::erase_if(durable.entries(),
                  [](const auto& entry) { return entry.topic == Topic::ModelState; });
    for (auto& entry : durable.entries()) entry.extra.ever = false;
  }
};

DdsBridge::DdsBridge(DdsOutlet& outlet) : state_(std::make_unique<State>(outlet)) {}
DdsBridge::~DdsBridge() = default;

void DdsBridge::connected() {
  lost();
  state_->durable.entries().clear();
}

void DdsBridge::beat(WallTime at, WallTime now) {
  state_->last_beat = std::max(state_->last_beat, std::min(at, now));
  state_->alive |= !state_->silent(now);
}

void DdsBridge::publish(Topic topic, std::span<std::byte> payload, WallTime at, WallTime now) {
  // Nothing is written to DDS while abbed seems silent. Only cycle() publishes that the source is
  // lost, not this function: a beat of abbed may follow this payload in the socket and show that
  // abbed is not silent.
  const bool alive = state_->alive && !state_->silent(now);
  const auto key = payload_key(topic, payload);
  if (!key) {
    ++state_->refused;
  } else if (is_durable(topic)) {
    state_->durable.keep(topic, key->bytes, payload);
    if (alive) state_->write_due_durable(now);
  } else if (alive) {
    state_->write_live(topic, payload, std::max(now - at, WallTime::duration::zero()));
  }
}

void DdsBridge::lost() {
  if (state_->alive) state_->report_source_lost();
}

void DdsBridge::cycle(WallTime now) {
  State& s = *state_;
  if (s.alive && s.silent(now)) s.report_source_lost();
  if (!s.alive) return;
  s.write_due_durable(now);
  if (now - s.last_assert < kAssertPeriod) return;
  s.outlet.assert_liveliness();
  s.last_assert = now;
}

bool DdsBridge::source_alive() const noexcept {
  return state_->alive;
}
std::uint64_t DdsBridge::written() const noexcept {
  return state_->written;
}
std::uint64_t DdsBridge::refused() const noexcept {
  return state_->refused;
}
std::uint64_t DdsBridge::outdated() const noexcept {
  return state_->outdated;
}

}  // namespace abbe::daemon

#include "watched_machines.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "abbe/base/json_text.hpp"
#include "abbe/base/message.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/dds/json_lines.hpp"
#include "abbe/messages/cdr.hpp"

namespace abbe::dds {
namespace {

using daemon::Topic;

/// Most machines that a subscriber of all machines keeps, because other participants may publish
/// any number of names.
constexpr std::size_t kMostMachines = 256;
/// Limits for all publishers together, because other participants may publish any amount: grid
/// nodes of 0.1 kB, bytes of samples not shown yet, and streams whose state is kept.
constexpr std::size_t kMostNodes = 1'000'000, kMostBytesNotShown = 64'000'000, kMostStreams = 4096;

/// A publisher is regarded as not alive if its last ModelState is older than this. Every publisher
/// repeats ModelState once a second, even if nothing changes.
constexpr std::chrono::milliseconds kLongestSilence{1500};

std::string micrometres(const std::array<double, 3>& v_m) {
  return fmt::format("{:+.2f} {:+.2f} {:+.2f} um", v_m[0] * 1e6, v_m[1] * 1e6, v_m[2] * 1e6);
}

/// The position as text. An axis that is missing in the sample is shown as "-", because its last
/// position is out of date.
std::string millimetres(const std::vector<double>& position_m, unsigned missing_mask) {
  std::string text;
  for (std::size_t axis = 0; axis < position_m.size(); ++axis) {
    const bool missing = (missing_mask >> axis & 1u) != 0;
    text += missing ? fmt::format("{:>10}", '-') : fmt::format("{:10.4f}", position_m[axis] * 1e3);
  }
  return text + " mm";
}

/// Prints the object as one line. Texts in it may come from any participant and need not be valid
/// UTF-8.
void print_object(const nlohmann::ordered_json& object) {
  std::printf("%s\n", daemon::json_text(object).c_str());
  std::fflush(stdout);
}

template <class T, class F>
void with(std::span<const std::byte> payload, F&& use) {
  if (auto value = daemon::decode<T>(payload)) {
    use(*value);
  } else {
    daemon::print_message("abbe-watch", value.error().text);
  }
}

}  // namespace

WatchedMachines::WatchedMachines(WatchOptions options, const Readers& readers,
                                 const ParticipantAddresses& addresses)
    : options_(std::move(options)),
      readers_(readers),
      addresses_(addresses),
      on_terminal_(::isatty(STDOUT_FILENO) != 0) {}

void WatchedMachines::take(const Arrival& arrival) {
  using Verdict = PublisherPin::Verdict;
  const auto key = daemon::payload_key(arrival.topic, arrival.payload);

  if (!key || (!options_.machine.empty() && key->machine != options_.machine)) return;
  received_ = true;
  const std::string name(key->machine);
  if (machines_.size() >= kMostMachines && !machines_.contains(name)) return;
  auto& machine =
      machines_.try_emplace(name, Machine{.pin = PublisherPin(options_.machine_id)}).first->second;
  const auto from = participant_of(arrival.writer);
  const auto former = machine.pin.pinned();
  const auto verdict = judge(arrival, machine.pin);
  auto& publisher = machine.publisher(from);
  keep(arrival, publisher, machine.pin.pinned() == from);
  if (verdict != Verdict::Pinned && verdict != Verdict::NewlyPinned) {
    keep_for_later(arrival, publisher);
    return report_ignored_publisher(name, machine, from, verdict);
  }

  if (former && former != from) show_successor(name, from, *former);
  if (verdict == Verdict::NewlyPinned && !machine.pin.machine_id())
    report_without_identity(name, machine, from);
  show_kept(name, machine, publisher);
  show(arrival, name, machine, publisher);
}

PublisherPin::Verdict WatchedMachines::judge(const Arrival& arrival, PublisherPin& pin) {
  const auto from = participant_of(arrival.writer);
  const auto now = WallClock::now();
  if (arrival.topic != Topic::Identity) return pin.heard(from, now);
  const auto identity = daemon::decode<v1::Identity>(arrival.payload);
  return identity ? pin.identified(
                        from, identity->machine_id(),
                        twin_of(identity->twin(), identity->twin_seen(), identity->machine()), now)
                  : pin.heard(from, now);
}

void WatchedMachines::keep_for_later(const Arrival& arrival, Publisher& publisher) {
  // limit for slices and for streams of a machine, with a margin
  constexpr std::size_t kMost = 256;
  const auto& traits = daemon::traits(arrival.topic);
  const auto key = daemon::payload_key(arrival.topic, arrival.payload);
  if (!options_.json || traits.kind != daemon::TopicTraits::Kind::Durable || !key) return;
  const auto* begin = reinterpret_cast<const char*>(key->bytes.data());
  std::string bytes(begin, key->bytes.size());
  if (publisher.not_shown.size() >= kMost) return;
  const auto sum = total([](const Publisher& p) { return p.not_shown_bytes; });
  if (sum + arrival.payload.size() > kMostBytesNotShown) return;
  auto& kept = publisher.not_shown[{arrival.topic, std::move(bytes)}];
  publisher.not_shown_bytes += arrival.payload.size() - kept.size();
  kept = {arrival.payload.begin(), arrival.payload.end()};
}

void WatchedMachines::show_kept(const std::string& name, Machine& machine, Publisher& publisher) {
  for (const auto& [key, payload] : std::exchange(publisher.not_shown, {}))
    print_sample(key.first, payload);
  publisher.not_shown_bytes = 0;
  show_liveness(name, machine);
  show_state(name, machine, publisher);
  show_model(machine, publisher);
}

void WatchedMachines::notice_losses() {
  for (auto& [name, machine] : machines_) {
    for (auto& [id, publisher] : machine.publishers)
      if (!alive(&publisher)) publisher.state_from.reset();
    show_liveness(name, machine);
    withdraw(name, machine);
  }
}

std::chrono::milliseconds WatchedMachines::until_next_loss(
    std::chrono::milliseconds at_most) const {
  const auto now = WallClock::now();
  for (const auto& [name, machine] : machines_) {
    if (!machine.applied) continue;
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(machine.applied->valid_until - now);
    at_most = std::clamp(left, std::chrono::milliseconds{1}, at_most);
  }
  return at_most;
}

Decision WatchedMachines::decide_on(Machine& machine, const Publisher& publisher,
                                    const v1::Compensation& c) const {
  const auto now = WallClock::now();
  auto decision = decide(c, publisher.last_delay, publisher.model.state(), alive(&publisher));
  machine.applied.reset();
  if (decision.apply) machine.applied = {c, *publisher.last_delay, now, now + decision.valid_for};
  return decision;
}

void WatchedMachines::withdraw(const std::string& name, Machine& machine) {
  if (!machine.applied) return;
  const Applied& a = *machine.applied;
  const Publisher* const publisher = machine.pinned();
  const auto decision =
      decide(a.vector, a.delay + (WallClock::now() - a.arrived),
             publisher == nullptr ? std::nullopt : publisher->model.state(), alive(publisher));
  if (decision.apply) return;

  if (options_.json) print_decision(a.vector, decision);
  print(fmt::format("{}  do not apply: {}", name, decision.reason));
  machine.shown_apply = false;
  machine.applied.reset();
}

const ReceivedModel* WatchedMachines::applicable() const {
  for (const auto& [name, machine] : machines_) {
    const Publisher* const publisher = machine.pinned();
    if (publisher == nullptr) continue;
    const auto& model = publisher->model;
    if (!model.model() || !model.decide(alive(publisher)).apply) continue;
    if (model.model()->model_id() == model.state()->model_id()) return &model;
  }
  return nullptr;
}

std::string WatchedMachines::why_not() const {
  std::string text;
  for (const auto& [name, machine] : machines_) {
    const Publisher* const publisher = machine.pinned();
    text += name + ": ";
    if (publisher == nullptr) {
      text += machine.why_none + "; ";
      continue;
    }
    const auto decision = publisher->model.decide(alive(publisher));
    text += (decision.apply ? std::string("no ErrorModel received") : decision.reason) + "; ";
  }
  return text.empty() ? "nothing received" : text;
}

bool WatchedMachines::alive(const Publisher* publisher) const {
  return publisher != nullptr && publisher->state_from &&
         WallClock::now() - publisher->state_at < kLongestSilence &&
         readers_.is_alive(*publisher->state_from);
}

void WatchedMachines::keep(const Arrival& arrival, Publisher& publisher, bool pinned) {
  switch (arrival.topic) {
    case Topic::ModelState:
      return with<v1::ModelState>(arrival.payload, [&](auto& m) {
        publisher.state_from = arrival.writer;
        publisher.state_at = WallClock::now();
        publisher.model.state(m);
      });
    case Topic::ErrorModel:
      return with<v1::ErrorModel>(arrival.payload, [&](auto& m) { publisher.model.model(m); });
    case Topic::ErrorGrid:
      if (!options_.keep_grids ||
          (!pinned && total([](const Publisher& p) { return p.model.kept_nodes(); }) >= kMostNodes))
        return;
      return with<v1::ErrorGrid>(arrival.payload, [&](auto& m) { publisher.model.slice(m); });
    case Topic::Snapshot:
      return with<v1::Snapshot>(arrival.payload, [&](auto& m) {
        publisher.position = millimetres(m.position(), m.missing_mask());
      });
    case Topic::Compensation:
      return with<v1::Compensation>(arrival.payload, [&](auto& m) {
        publisher.last_delay = publisher.delay.of(m, WallClock::now());
      });
    case Topic::Identity:
    case Topic::Health:
    case Topic::CalibrationEvent:
      return;  // the sample was shown when it arrived, and is not kept
  }
}

void WatchedMachines::show(const Arrival& arrival, const std::string& name, Machine& machine,
                           const Publisher& publisher) {
  const auto& payload = arrival.payload;
  if (options_.json) print_sample(arrival.topic, payload);
  show_liveness(name, machine);
  show_state(name, machine, publisher);
  if (arrival.topic == Topic::ErrorModel) show_model(machine, publisher);
  if (arrival.topic == Topic::Health) with<v1::Health>(payload, [&](auto& m) { show_health(m); });
  if (arrival.topic == Topic::CalibrationEvent)
    with<v1::CalibrationEvent>(payload, [&](auto& m) { show_event(m); });
  if (arrival.topic == Topic::Compensation)
    with<v1::Compensation>(payload, [&](auto& m) { show_vector(machine, publisher, m); });
}

void WatchedMachines::print_sample(Topic topic, std::span<const std::byte> payload) {
  if (const auto line = json_line(topic, payload)) std::printf("%s\n", line->c_str());
  std::fflush(stdout);
}

void WatchedMachines::print(const std::string& line) {
  if (options_.json) return;
  std::printf("%s%s\n", on_terminal_ ? "\r\033[K" : "", daemon::printable_line(line).c_str());
  std::fflush(stdout);
}

void WatchedMachines::show_liveness(const std::string& name, Machine& machine) {
  const bool now = alive(machine.pinned());
  if (std::exchange(machine.shown_alive, now) == now) return;
  if (options_.json) print_object({{"machine", name}, {"publisher_alive", now}});
  print(fmt::format("{}  {}", name,
                    now ? "publisher is alive" : "publisher is not alive: do not apply"));
}

std::string WatchedMachines::described(const ParticipantId& id) const {
  const auto address = addresses_.of(id);
  return text_of(id) + (address.empty() ? "" : ", announced at " + address);
}

void WatchedMachines::show_successor(const std::string& name, const ParticipantId& id,
                                     const ParticipantId& former) {
  if (options_.json)
    print_object({{"machine", name}, {"publisher", text_of(id)}, {"former", text_of(former)}});
  print(fmt::format("{}  publisher is now {}: {} sends no more", name, described(id),
                    text_of(former)));
}

void WatchedMachines::report_without_identity(const std::string& name, Machine& machine,
                                              const ParticipantId& id) {
  if (std::exchange(machine.without_identity_reported, true)) return;
  const auto why = fmt::format(
      "publisher {} states no identity (an abbe-dds of an earlier version): used by its name alone",
      described(id));
  if (options_.json) print_object({{"machine", name}, {"publisher", text_of(id)}, {"reason", why}});
  print(name + "  " + why);
}

void WatchedMachines::report_ignored_publisher(const std::string& name, Machine& machine,
                                               const ParticipantId& id,
                                               PublisherPin::Verdict verdict) {
  using Verdict = PublisherPin::Verdict;
  constexpr std::chrono::seconds kReportPeriod{10};
  if (verdict == Verdict::Waiting) return;
  const std::string stated = machine.pin.stated_by(id).value_or("");
  std::string why = "another publisher " + described(id) +
                    ": ignored; stop it, or use DDS Security (abbe dds keys)";
  if (verdict == Verdict::OtherMachine)
    why = fmt::format("another machine of this name, machine_id {}, publisher {}: ignored", stated,
                      described(id));
  if (verdict == Verdict::Ambiguous)
    why = fmt::format(
        "several machines have this name: nothing is used without --machine-id; publisher {} has "
        "machine_id {}",
        described(id), stated);
  if (verdict == Verdict::Copied)
    why = fmt::format(
        "several publishers have machine_id {}: {}; give the copy an identity of its own (abbe "
        "machine identity new); publisher {}",
        stated.empty() ? "none" : stated,
        machine.pin.pinned() ? "the first one stays in use" : "nothing is used", described(id));
  if (verdict == Verdict::Unidentified)
    why = fmt::format("publisher {} has no machine_id: ignored; see Health of stream identity",
                      described(id));
  machine.why_none = why;

  const auto now = WallClock::now();
  if (machine.ignored_reported && now - *machine.ignored_reported < kReportPeriod) return;
  machine.ignored_reported = now;
  if (options_.json)
    print_object({{"machine", name},
                  {"rival", text_of(id)},
                  {"address", addresses_.of(id)},
                  {"machine_id", stated},
                  {"reason", why}});
  print(name + "  " + why);
}

void WatchedMachines::show_state(const std::string& name, Machine& machine,
                                 const Publisher& publisher) {
  const auto& s = publisher.model.state();
  if (!s) return;
  const std::string line =
      fmt::format("{}  model {} is {}{}{}", name, s->model_id().empty() ? "-" : s->model_id(),
                  name_of(s->state()), s->reason().empty() ? "" : ": ", s->reason());
  if (std::exchange(machine.shown_state, line) != line) print(line);
}

void WatchedMachines::show_model(Machine& machine, const Publisher& publisher) {
  const auto& m = publisher.model.model();
  if (!m || std::exchange(machine.shown_model, m->model_id()) == m->model_id()) return;
  print(fmt::format("{}  received model {}: {} {}, datum {}, {} parameters, chain {}", m->machine(),
                    m->model_id(), m->method(), m->estimator(), m->gauge(), m->parameters().size(),
                    m->chain()));
}

void WatchedMachines::show_health(const v1::Health& h) {
  const std::string line = fmt::format("{}  {} {}{}{}", h.machine(), h.stream(), h.state(),
                                       h.fault().empty() ? "" : ": ", h.fault());
  if (health_.size() >= kMostStreams) health_.clear();  // each state is then printed once more
  if (std::exchange(health_[{h.machine(), h.stream()}], line) != line) print(line);
}

void WatchedMachines::show_event(const v1::CalibrationEvent& e) {
  const std::string line = fmt::format("{}  calibration {} {}{}{}", e.machine(), e.method(),
                                       e.state(), e.reason().empty() ? "" : ": ", e.reason());
  if (std::exchange(calibration_[e.machine()], line) != line) print(line);
}

void WatchedMachines::print_decision(const v1::Compensation& c, const Decision& decision) {
  const auto now = WallClock::now().time_since_epoch();
  print_object({{"machine", c.machine()},
                {"decision",
                 {{"sequence_number", c.sequence_number()},
                  {"apply", decision.apply},
                  {"reason", decision.reason},
                  {"monotonic_ns", std::chrono::nanoseconds(now).count()},
                  {"valid_for_ns", decision.valid_for.count()}}}});
}

void WatchedMachines::show_vector(Machine& machine, const Publisher& publisher,
                                  const v1::Compensation& c) {
  const auto decision = decide_on(machine, publisher, c);
  if (options_.json) return print_decision(c, decision);
  const auto now = WallClock::now();
  const auto period = on_terminal_ ? std::chrono::milliseconds{100} : std::chrono::seconds{1};
  if (decision.apply == machine.shown_apply && now - machine.last_live < period) return;
  machine.last_live = now;
  machine.shown_apply = decision.apply;
  const std::string line =
      fmt::format("{}  {}  V {}  {}", c.machine(), publisher.position, micrometres(c.vector_m()),
                  decision.apply ? "apply" : "do not apply: " + decision.reason);
  std::printf(on_terminal_ ? "\r\033[K%s" : "%s\n", daemon::printable_line(line).c_str());
  std::fflush(stdout);
}

}  // namespace abbe::dds

// SPDX-License-Identifier: GPL-2.0-or-later
#include "subscription.hpp"

#include <utility>

#include "abbe/dds/grid_nodes.hpp"
#include "abbe/messages/cdr.hpp"

namespace abbe::linuxcnc {
namespace {

using daemon::Topic;

/// A ModelState older than this is not valid; abbe-dds repeats it every second
/// (daemon/docs/dds.md).
constexpr std::chrono::milliseconds kLongestSilence{1500};

/// Decodes the payload and calls `use`. Malformed payloads are skipped, because any participant of
/// the domain may send them.
template <class T, class Use>
void with(const dds::Arrival& arrival, Use use) {
  if (auto value = daemon::decode<T>(arrival.payload)) use(std::move(*value));
}

}  // namespace

std::shared_ptr<const Usable> Subscription::poll(std::chrono::milliseconds at_most) {
  readers_.wait(at_most);
  readers_.take([this](const dds::Arrival& arrival) { take(arrival); });

  std::string reason = why_not();
  const bool was_usable = usable_->field.has_value();
  if (!reason.empty()) {
    if (was_usable || usable_->reason != reason)
      usable_ = std::make_shared<const Usable>(Usable{.field = {}, .reason = std::move(reason)});
    return usable_;
  }

  const dds::ReceivedModel& model = publishers_.at(*pin_.pinned()).model;
  const std::string& id = model.state()->model_id();
  if (was_usable && usable_->model_id == id && !std::exchange(grid_changed_, false)) return usable_;

  grid_changed_ = false;
  const auto nodes = model.grid();
  auto lattice = dds::lattice_of(*nodes);
  const auto& t = model.model()->tool_offset_m();
  usable_ = std::make_shared<const Usable>(
      lattice ? Usable{.field = std::move(*lattice),
                       .model_id = id,
                       .tool_offset_m = Eigen::Vector3d(t[0], t[1], t[2]),
                       .identified = pin_.machine_id().has_value()}
              : Usable{.field = {}, .reason = lattice.error().text});
  return usable_;
}

void Subscription::take(const dds::Arrival& arrival) {
  const auto key = daemon::payload_key(arrival.topic, arrival.payload);
  if (!key || key->machine != machine_) return;

  const auto from = dds::participant_of(arrival.writer);
  judge(arrival, from);
  keep(arrival, publishers_[from]);
  std::erase_if(publishers_, [this](const auto& p) { return !pin_.remembers(p.first); });
}

void Subscription::judge(const dds::Arrival& arrival, const dds::ParticipantId& from) {
  using Verdict = dds::PublisherPin::Verdict;
  auto verdict = Verdict::Waiting;
  if (arrival.topic == Topic::Identity) {
    with<v1::Identity>(arrival, [&](v1::Identity&& identity) {
      verdict = pin_.identified(from, identity.machine_id(),
                                dds::twin_of(identity.twin(), identity.twin_seen(), machine_),
                                Clock::now());
    });
  } else {
    verdict = pin_.heard(from, Clock::now());
  }
  if (verdict == Verdict::OtherMachine)
    why_none_ = "machine_id " + pin_.stated_by(from).value_or("") + " is another machine";
  if (verdict == Verdict::Ambiguous)
    why_none_ = "several machines have this name: give --machine-id";
  if (verdict == Verdict::Copied)
    why_none_ = "several publishers have machine_id " + pin_.stated_by(from).value_or("(none)") +
                ": give the copy an identity of its own";
  if (verdict == Verdict::Unidentified)
    why_none_ = "the publisher has no machine_id: see Health of stream identity";
}

void Subscription::keep(const dds::Arrival& arrival, Publisher& publisher) {
  switch (arrival.topic) {
    case Topic::ModelState:
      return with<v1::ModelState>(arrival, [&](v1::ModelState&& state) {
        publisher.state_from = arrival.writer;
        publisher.state_at = Clock::now();
        publisher.model.state(std::move(state));
      });
    case Topic::ErrorModel:
      return with<v1::ErrorModel>(
          arrival, [&](v1::ErrorModel&& model) { publisher.model.model(std::move(model)); });
    case Topic::ErrorGrid:
      return with<v1::ErrorGrid>(arrival, [&](v1::ErrorGrid&& slice) {
        publisher.model.slice(std::move(slice));
        grid_changed_ = true;
      });
    default:
      return;
  }
}

bool Subscription::alive(const Publisher& publisher) const {
  return publisher.state_from && Clock::now() - publisher.state_at < kLongestSilence &&
         readers_.is_alive(*publisher.state_from);
}

std::string Subscription::why_not() const {
  const auto pinned = pin_.pinned();
  const auto found = pinned ? publishers_.find(*pinned) : publishers_.end();
  if (found == publishers_.end())
    return "nothing received about machine \"" + machine_ + "\"" +
           (why_none_.empty() ? "" : ": " + why_none_);

  const Publisher& publisher = found->second;
  const auto decision = publisher.model.decide(alive(publisher));
  return decision.apply ? why_not_model(publisher) : decision.reason;
}

std::string Subscription::why_not_model(const Publisher& publisher) const {
  const auto& model = publisher.model.model();
  if (!model || model->model_id() != publisher.model.state()->model_id())
    return "no ErrorModel received of the active model";
  return {};
}

}  // namespace abbe::linuxcnc

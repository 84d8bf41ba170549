#include "abbe/dds/received_model.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

namespace abbe::dds {
namespace {

Decision refuse(std::string reason) {
  return {false, std::move(reason), {}};
}

Decision decide_by_state(const std::optional<v1::ModelState>& state, bool publisher_alive) {
  if (!state) return refuse("no ModelState received");
  if (!publisher_alive) return refuse("the ModelState publisher is not alive");
  if (state->state() != v1::MODEL_ACTIVE) {
    return refuse(std::string("ModelState is ") + name_of(state->state()) +
                  (state->reason().empty() ? "" : ": " + state->reason()));
  }
  return {true, name_of(state->state()), {}};
}

}  // namespace

const char* name_of(v1::ModelStatus status) noexcept {
  constexpr std::array names{"NONE", "ACTIVE", "STALE", "DRIFT", "INVALID"};
  return status < names.size() ? names[status] : "unknown";
}

void ReceivedModel::state(v1::ModelState state) {
  const bool another = !state_ || state_->model_id() != state.model_id();
  state_ = std::move(state);
  if (another)
    std::erase_if(slices_, [this](const auto& of) { return of.first != state_->model_id(); });
}

void ReceivedModel::slice(v1::ErrorGrid slice) {
  // This is enough for the model that ModelState names, the next model, and remaining slices of old
  // models.
  constexpr std::size_t kMostModels = 4;
  // This is several times the number that abbe-dds sends for the largest grid. The limit protects
  // the memory against other participants.
  constexpr std::uint32_t kMostSlices = 32;
  if (slice.slices() == 0 || slice.slices() > kMostSlices || slice.slice() >= slice.slices())
    return;
  if (slices_.size() >= kMostModels && !slices_.contains(slice.model_id()))
    std::erase_if(slices_,
                  [this](const auto& of) { return !state_ || of.first != state_->model_id(); });
  Slices& of_model = slices_[slice.model_id()];
  std::erase_if(of_model, [&](const auto& s) { return s.second.slices() != slice.slices(); });
  of_model[slice.slice()] = std::move(slice);
}

std::size_t ReceivedModel::kept_nodes() const {
  std::size_t nodes = 0;
  for (const auto& [model, slices] : slices_)
    for (const auto& [number, slice] : slices) nodes += slice.nodes().size();
  return nodes;
}

std::optional<std::vector<v1::GridNode>> ReceivedModel::grid() const {
  if (!state_) return std::nullopt;
  const auto of_model = slices_.find(state_->model_id());
  if (of_model == slices_.end() ||
      of_model->second.size() != of_model->second.begin()->second.slices())
    return std::nullopt;
  std::vector<v1::GridNode> nodes;
  for (const auto& [number, slice] : of_model->second)
    nodes.insert(nodes.end(), slice.nodes().begin(), slice.nodes().end());
  return nodes;
}

Decision ReceivedModel::decide(bool publisher_alive) const {
  Decision decision = decide_by_state(state_, publisher_alive);
  if (decision.apply && !grid())
    return refuse("the grid of model " + state_->model_id() + " is not complete");
  return decision;
}

Decision decide(const v1::Compensation& c, std::optional<std::chrono::nanoseconds> delay,
                const std::optional<v1::ModelState>& state, bool publisher_alive) {
  Decision decision = decide_by_state(state, publisher_alive);
  if (!decision.apply) return decision;

  if (c.state() != v1::MODEL_ACTIVE) return refuse(std::string("vector is ") + name_of(c.state()));
  if (c.model_id() != state->model_id()) return refuse("vector is of another model");
  if (!c.inside()) return refuse("outside the volume that the calibration data covered");
  if (!c.tool_ok()) return refuse("the model is not valid for this tool");
  if (!delay) return refuse("the transit time is not known yet");

  // The values may come from any participant, so the comparison avoids sums, which could overflow.
  if (c.age_ns() < 0 || c.validity_ns() < 0 || c.age_ns() > c.validity_ns() - delay->count())
    return refuse("older than its validity");
  decision.valid_for = std::chrono::nanoseconds{c.validity_ns() - delay->count() - c.age_ns()};
  return decision;
}

std::optional<std::chrono::nanoseconds> Delay::of(const v1::Compensation& vector, Instant now) {
  constexpr std::chrono::nanoseconds kLongestStep = std::chrono::seconds{1};
  // Longest time that is accepted in a vector. abbe-dds sends no longer times, and the sum of two
  // longer times could overflow.
  constexpr std::int64_t kLongest_ns = std::int64_t{1} << 60;
  for (const std::int64_t time : {vector.host_time_ns(), vector.age_ns()})
    if (time < 0 || time > kLongest_ns) return std::nullopt;

  const std::chrono::nanoseconds published{vector.host_time_ns() + vector.age_ns()};
  const std::chrono::nanoseconds offset = now.time_since_epoch() - published;
  const bool same_clock = least_ && std::chrono::abs(offset - *least_) <= kSameClock;
  if (std::exchange(inherited_, false) && !same_clock) *this = {};

  const auto drifted = least_ ? *least_ + std::min(now - last_, kLongestStep) / kDrift : offset;
  least_ = std::min(offset, drifted);
  last_ = now;
  if (!first_) first_ = now;
  if (now - *first_ <= kFirst) return std::nullopt;

  return offset - *least_;
}

Delay Delay::for_next_publisher() const {
  Delay next = *this;
  next.inherited_ = true;
  return next;
}

}  // namespace abbe::dds

#include "abbe/dds/received_model.hpp"

#include <array>
#include <utility>

namespace abbe::dds {
namespace {

Decision refuse(std::string reason) {
  return {false, std::move(reason)};
}

Decision decide_by_state(const std::optional<v1::ModelState>& state, bool answered_for) {
  if (!state) return refuse("no ModelState received");
  if (!answered_for) return refuse("nobody answers for ModelState");
  if (state->state() != v1::MODEL_ACTIVE) {
    return refuse(std::string("ModelState is ") + name_of(state->state()) +
                  (state->reason().empty() ? "" : ": " + state->reason()));
  }
  return {true, name_of(state->state())};
}

}  // namespace

const char* name_of(v1::ModelStatus status) noexcept {
  constexpr std::array names{"NONE", "ACTIVE", "STALE", "DRIFT", "INVALID"};
  return status < names.size() ? names[status] : "unknown";
}

void ReceivedModel::state(v1::ModelState state) {
  const bool another = !state_ || state_->model_id() != state.model_id();
  state_ = std::move(state);
  if (another) std::erase_if(slices_, [this](const auto& of) { return of.first != state_->model_id(); });
}

void ReceivedModel::slice(v1::ErrorGrid slice) {
  constexpr std::size_t kMostModels = 4;  // the state's, the next one, and what is left of others
  if (slices_.size() >= kMostModels && !slices_.contains(slice.model_id()))
    std::erase_if(slices_, [this](const auto& of) { return !state_ || of.first != state_->model_id(); });
  Slices& of_model = slices_[slice.model_id()];
  std::erase_if(of_model, [&](const auto& s) { return s.second.slices() != slice.slices(); });
  of_model[slice.slice()] = std::move(slice);
}

std::optional<std::vector<v1::GridNode>> ReceivedModel::grid() const {
  if (!state_) return std::nullopt;
  const auto of_model = slices_.find(state_->model_id());
  if (of_model == slices_.end() || of_model->second.size() != of_model->second.begin()->second.slices())
    return std::nullopt;
  std::vector<v1::GridNode> nodes;
  for (const auto& [number, slice] : of_model->second)
    nodes.insert(nodes.end(), slice.nodes().begin(), slice.nodes().end());
  return nodes;
}

Decision ReceivedModel::decide(bool answered_for) const {
  Decision decision = decide_by_state(state_, answered_for);
  if (decision.apply && !grid())
    return refuse("the grid of model " + state_->model_id() + " is not complete");
  return decision;
}

Decision decide(const v1::Compensation& c, const std::optional<v1::ModelState>& state, bool answered_for) {
  Decision decision = decide_by_state(state, answered_for);
  if (!decision.apply) return decision;
  if (c.state() != v1::MODEL_ACTIVE) return refuse(std::string("vector is ") + name_of(c.state()));
  if (c.model_id() != state->model_id()) return refuse("vector is of another model");
  if (!c.inside()) return refuse("outside the volume the data covered");
  if (!c.tool_ok()) return refuse("the model does not hold for this tool");
  if (c.age_ns() > c.validity_ns()) return refuse("older than its validity");
  return decision;
}

}  // namespace abbe::dds

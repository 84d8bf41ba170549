/// Orders of an operator to a tracker, and the reflector list of its controller.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <utility>

#include "abbe/drivers/tracker/session.hpp"
#include "refusals.hpp"

namespace abbe::drivers {
namespace {

constexpr double kMillimetresPerMetre = 1000.0;
// Limit of the list of reflectors, so that a faulty controller cannot extend it without end.
constexpr std::int32_t kMostReflectors = 256;

/// True for control characters. They are replaced in names, because a terminal would execute them.
bool is_control(char32_t c) {
  return c < 0x20 || (c >= 0x7F && c < 0xA0);
}

/// Converts the controller's UTF-16 to UTF-8; an unpaired surrogate or a control character becomes
/// a question mark.
std::string utf8_of(const emscon::Name& name) {
  std::string out;
  const auto put = [&out](char32_t c) {
    if (c < 0x80) {
      out += static_cast<char>(c);
    } else if (c < 0x800) {
      out += static_cast<char>(0xC0 | c >> 6);
      out += static_cast<char>(0x80 | (c & 0x3F));
    } else if (c < 0x10000) {
      out += static_cast<char>(0xE0 | c >> 12);
      out += static_cast<char>(0x80 | (c >> 6 & 0x3F));
      out += static_cast<char>(0x80 | (c & 0x3F));
    } else {
      out += static_cast<char>(0xF0 | c >> 18);
      out += static_cast<char>(0x80 | (c >> 12 & 0x3F));
      out += static_cast<char>(0x80 | (c >> 6 & 0x3F));
      out += static_cast<char>(0x80 | (c & 0x3F));
    }
  };

  for (std::size_t i = 0; i < name.size() && name[i] != 0; ++i) {
    const char32_t unit = name[i];
    const bool high = unit >= 0xD800 && unit < 0xDC00;
    const bool pair = high && i + 1 < name.size() && name[i + 1] >= 0xDC00 && name[i + 1] < 0xE000;
    if (pair) {
      put(0x10000 + ((unit - 0xD800) << 10) + (static_cast<char32_t>(name[++i]) - 0xDC00));
    } else {
      put((unit >= 0xD800 && unit < 0xE000) || is_control(unit) ? U'?' : unit);
    }
  }

  return out;
}

std::optional<std::int32_t> as_id(const std::string& text) {
  std::int32_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return id;
}

}  // namespace

const char* name_of(TrackerOrder::What what) noexcept {
  switch (what) {
    case TrackerOrder::What::Initialize:
      return "initialize";
    case TrackerOrder::What::ListReflectors:
      return "reflector list";
    case TrackerOrder::What::SetReflector:
      return "reflector set";
    case TrackerOrder::What::GoHome:
      return "home";
    case TrackerOrder::What::FindReflector:
      return "find";
  }

  return "order";
}

// --- reflectors

/// Plans GetReflector (the reflector in use), then GetReflectors (one answer per reflector of the
/// list). SetReflector is planned when the list is complete.
void TrackerSession::plan_reflector(TrackerState state, bool of_order) {
  plan(state, emscon::GetReflector{}, true, of_order);
  plan(state, emscon::GetReflectors{}, as_id(wanted_reflector()).has_value(), of_order);
}

const std::string& TrackerSession::wanted_reflector() const {
  const bool ordered = order_begun_ && order_->what == TrackerOrder::What::SetReflector;
  return ordered ? order_->reflector : options_.reflector;
}

bool TrackerSession::list_complete(const emscon::Answer& answer) {
  const auto* one = std::get_if<emscon::ReflectorsAnswer>(&answer);
  if (one == nullptr) return true;
  reflectors_.push_back(
      {one->internal_id, utf8_of(one->name), reflector_in_use_ == one->internal_id});
  return static_cast<std::int32_t>(reflectors_.size()) >= std::min(one->total, kMostReflectors);
}

/// Called when the list is complete. Plans SetReflector unless the reflector is already set:
/// SetReflector would lose the beam. Returns an error text, or an empty string.
std::string TrackerSession::choose_reflector() {
  if (order_begun_ && order_->what == TrackerOrder::What::ListReflectors) return {};
  const std::string& wanted = wanted_reflector();
  const auto id = as_id(wanted);
  const auto known =
      std::find_if(reflectors_.begin(), reflectors_.end(),
                   [&](const TrackerReflector& r) { return r.name == wanted || r.id == id; });

  if (known == reflectors_.end() && !reflectors_.empty()) {
    std::vector<std::string> names;
    for (const TrackerReflector& r : reflectors_)
      names.push_back(fmt::format("\"{}\" ({})", r.name, r.id));
    return fmt::format("reflector \"{}\" is not in the controller's list: known are {}", wanted,
                       fmt::join(names, ", "));
  }

  const std::int32_t chosen = known != reflectors_.end() ? known->id : id.value_or(0);
  if (reflector_in_use_ == chosen) return {};
  const Step list = plan_[step_ - 1];
  if (!list.of_order && !reflector_before_) reflector_before_ = reflector_in_use_;
  plan_.insert(plan_.begin() + static_cast<std::ptrdiff_t>(step_),
               Step{list.state, emscon::SetReflector{chosen}, false, list.of_order});

  return {};
}

// --- orders

bool TrackerSession::takes_orders() const noexcept {
  return !stopped_ && (state_ == TrackerState::Streaming || without_beam() ||
                       (state_ == TrackerState::Ready && options_.mode == TrackerMode::Stationary));
}

TrackerAction TrackerSession::take(const TrackerOrder& order) {
  const auto refuse_order = [&](std::string text) -> TrackerAction {
    report_ = TrackerOrderReport{order.number, Outcome::Refused, std::move(text), {}};
    return TrackerNothing{};
  };
  if (order_) return refuse_order(fmt::format("{} is in progress", name_of(order_->what)));
  if (!takes_orders()) {
    return refuse_order(
        fmt::format("the tracker is {}{}{}", name_of(state_), cause_.empty() ? "" : ": ", cause_));
  }
  order_ = order;
  order_begun_ = false;
  deadlines_.set(Due::Order, now_);
  return pending_ ? TrackerAction{TrackerNothing{}} : begin_order();
}

TrackerAction TrackerSession::begin_order() {
  using enum TrackerState;
  order_begun_ = true;
  deadlines_.cancel(Due::Order);
  const TrackerOrder& order = *order_;
  const bool measuring = state_ == Streaming || state_ == BeamLost;

  if (order.what == TrackerOrder::What::ListReflectors) {
    const auto restart_at = deadlines_.at(Due::Restart);  // keeps a planned StartMeasurement
    new_plan(Goal::Stay);
    deadlines_.set(Due::Restart, restart_at);
    plan(std::nullopt, emscon::GetReflector{}, true, true);
    plan(std::nullopt, emscon::GetReflectors{}, false, true);
    return next_step();
  }

  new_plan(Goal::Stream);
  without_deadline_of_state();
  cause_ = fmt::format("\"{}\" was asked for", name_of(order.what));
  if (measuring) plan(Moving, emscon::StopMeasurement{}, true);

  switch (order.what) {
    case TrackerOrder::What::Initialize:
      plan(Initialising, emscon::Initialize{}, false, true);
      if (options_.home_after_initialize) plan(Moving, emscon::GoBirdBath{}, false, true);
      break;
    case TrackerOrder::What::SetReflector:
      plan_reflector(Moving, true);
      break;
    case TrackerOrder::What::GoHome:
      plan(Moving, emscon::GoBirdBath{}, false, true);
      break;
    case TrackerOrder::What::FindReflector:
      plan(Moving, emscon::FindReflector{kMillimetresPerMetre * order.distance_m}, false, true);
      break;
    case TrackerOrder::What::ListReflectors:
      break;
  }

  plan(Ready, emscon::StartMeasurement{});
  return next_step();
}

std::string TrackerSession::outcome_of(const TrackerOrder& order) const {
  switch (order.what) {
    case TrackerOrder::What::Initialize:
      return "the tracker is initialised";
    case TrackerOrder::What::ListReflectors:
      return fmt::format("the controller lists {} reflectors", reflectors_.size());
    case TrackerOrder::What::SetReflector:
      return fmt::format("reflector {} is set", order.reflector);
    case TrackerOrder::What::GoHome:
      return "the beam is at the bird bath";
    case TrackerOrder::What::FindReflector:
      return "the reflector was found";
  }

  return {};
}

void TrackerSession::end_order(Outcome outcome, const std::string& text) {
  if (!order_) return;
  TrackerOrderReport report{order_->number, outcome, text, {}};
  if (report.done() && order_->what == TrackerOrder::What::ListReflectors)
    report.reflectors = reflectors_;
  if (report.done() && order_->what == TrackerOrder::What::SetReflector) {
    options_.reflector = order_->reflector;  // this reflector is also used for later connections
    reflector_before_.reset();  // the reflector that the operator chose is not replaced at the end
  }
  report_ = std::move(report);
  order_.reset();
  order_begun_ = false;
  deadlines_.cancel(Due::Order);
}

}  // namespace abbe::drivers

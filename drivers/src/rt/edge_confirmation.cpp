#include "abbe/drivers/sampling/edge_confirmation.hpp"

namespace abbe::drivers {

EdgeConfirmation::Event EdgeConfirmation::begin(const EdgeInterval& edge, bool several) ABBE_RT {
  const Event event = state_ == State::Pending ? Event::Dismissed : Event::Began;
  state_ = State::Pending;
  first_ = edge;
  chattered_ = several;
  return event;
}

EdgeConfirmation::Event EdgeConfirmation::confirm() ABBE_RT {
  state_ = State::Touched;
  return Event::Confirmed;
}

EdgeConfirmation::Event EdgeConfirmation::on_time(std::int64_t now) ABBE_RT {
  if (state_ != State::Pending) return Event::Nothing;
  if (!rules_.counter_debounced)
    return now - last_edge_ >= rules_.confirm ? confirm() : Event::Nothing;
  // The factor 1.5 is a tolerance for the coarse steps of the card's debounce times.
  if (now - last_edge_ <= rules_.confirm + rules_.confirm / 2) return Event::Nothing;
  state_ = State::Armed;
  return Event::Dismissed;
}

EdgeConfirmation::Event EdgeConfirmation::on_edge(const EdgeInterval& edge, bool several) ABBE_RT {
  last_edge_ = edge.to;
  if (state_ == State::Touched) return Event::Nothing;
  if (state_ == State::Armed || edge.to - first_.to > rules_.chatter) return begin(edge, several);
  chattered_ = true;
  return Event::Nothing;
}

EdgeConfirmation::Event EdgeConfirmation::on_counted(const EdgeInterval& edge) ABBE_RT {
  if (state_ == State::Touched) {
    last_edge_ = edge.to;
    return Event::Nothing;
  }
  if (state_ == State::Armed) {
    last_edge_ = edge.to;
    (void)begin(edge, false);
  }
  return confirm();
}

void EdgeConfirmation::rearm() ABBE_RT {
  state_ = State::Armed;
  chattered_ = false;
}

}  // namespace abbe::drivers

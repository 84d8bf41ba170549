#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

std::string_view name(Mode mode) {
  return mode == Mode::Standstill ? "standstill" : "on-the-fly";
}

std::optional<Mode> mode_named(std::string_view text) {
  for (const Mode mode : {Mode::OnTheFly, Mode::Standstill}) {
    if (text == name(mode)) {
      return mode;
    }
  }
  return std::nullopt;
}

std::string_view name(Estimator estimator) {
  return estimator == Estimator::Simultaneous ? "simultaneous" : "two-step";
}

std::optional<Estimator> estimator(std::string_view name) {
  for (const Estimator one : {Estimator::TwoStep, Estimator::Simultaneous}) {
    if (name == otf::name(one)) {
      return one;
    }
  }
  return std::nullopt;
}

std::string_view name(Stage stage) {
  switch (stage) {
    case Stage::Observe:
      return "observe";
    case Stage::Align:
      return "align";
    case Stage::Solve:
      return "solve";
    case Stage::Judge:
      return "judge";
  }
  return "";
}

}  // namespace abbe::calib::otf

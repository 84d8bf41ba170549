// Joint identification of an on-the-fly run, a ball array and a Multi-Feature Bar of one machine
// (joint_triple.hpp), many random machines:
// - arrays of wrong length, by 5 u of the directed difference from the run, or from run and bar:
//   how many are found, and in how many the length of the array is named first; beside it, how many
//   the chi-square of the pairs alone would find at the same level. Of three parts each is compared
//   with the others, so that the limit of a test is a third: 5 u are found with a probability of
//   0.92 instead of 0.96;
// - sound parts: how many are refused, at the default level and at 5 %;
// - mean u of V of all parts, and of the best two; squared error of the joint model over its stated
//   covariance.
// Arguments: [MACHINES [SOUND [FIRST_SEED]]], by default 200, 100, 1.
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>
#include <vector>

#include "abbe/calib/joint/contribution.hpp"
#include "abbe/calib/otf/judge/lack_of_fit.hpp"
#include "figure.hpp"
#include "joint_triple.hpp"

namespace abbe::tests::never_worse {
namespace {

using calib::Vector3;
using joint::Triple;
using joint::TripleMachine;

constexpr double kErrorInU = 5.0;

/// Run, array and bar, or run and array only.
std::vector<calib::joint::Part> parts_of(const Triple& t, bool with_bar) {
  return {t.parts.begin(), with_bar ? t.parts.end() : t.parts.begin() + 2};
}

double u_of_length(const Triple& t, bool with_bar) {
  const auto tests = calib::joint::test_directions(parts_of(t, with_bar), t.common);
  const auto of_array =
      std::find_if(tests->begin(), tests->end(), [](const calib::joint::DirectedTest& test) {
        return test.part == 1 && test.direction == calib::joint::kLength;
      });
  return of_array->u;
}

struct WrongLengths {
  int machines = 0, found = 0, first = 0, by_chi_square = 0;
};

void count_wrong_length(WrongLengths& w, const TripleMachine& m, const calib::mfb::Plan& plan,
                        bool with_bar) {
  const double sign = m.seed % 2 == 0 ? 1.0 : -1.0;
  const double error = sign * kErrorInU * u_of_length(joint::triple(m, plan), with_bar);
  const Triple wrong = joint::triple(m, plan, error);
  const auto parts = parts_of(wrong, with_bar);
  const auto result = calib::joint::identify(parts, wrong.common);
  // A longer array states lengths that are too small.
  const std::string cause =
      error > 0.0 ? "array: its lengths are smaller" : "array: its lengths are larger";
  const double level = calib::joint::JointOptions{}.false_alarm /
                       static_cast<double>(std::max<std::size_t>(1, result->pairs.size()));
  ++w.machines;
  w.found += result->contradictions.empty() ? 0 : 1;
  w.first += !result->contradictions.empty() && result->contradictions.front().starts_with(cause);
  w.by_chi_square += std::any_of(result->pairs.begin(), result->pairs.end(),
                                 [&](const calib::joint::PairTest& p) { return p.all.p < level; });
}

bool measure_wrong_lengths(int machines, unsigned first_seed, const calib::mfb::Plan& plan) {
  constexpr int kOfTwo = 95, kOfThree = 88;  // percent; 0.92 scatters by 2 % in 200 machines
  bool met = true;
  for (const bool with_bar : {false, true}) {
    WrongLengths w;
    for (int i = 0; i < machines; ++i) {
      count_wrong_length(w, joint::triple_machine(first_seed + static_cast<unsigned>(i)), plan,
                         with_bar);
    }
    const int least = with_bar ? kOfThree : kOfTwo;
    print_figure(fmt::format("joint, {}: arrays wrong in length by {} u",
                             with_bar ? "run, array and bar" : "run and array", kErrorInU),
                 fmt::format("{} % found, 9 of 10 of these named first", least),
                 "{} of {} found, {} named first; chi-square of pairs alone {}", w.found,
                 w.machines, w.first, w.by_chi_square);
    met = met && 100 * w.found >= least * w.machines && 10 * w.first >= 9 * w.found;
  }
  return met;
}

/// Squared error of the joint model over its covariance, per combination that is determined.
double normalised_square(const TripleMachine& m, const Triple& t,
                         const calib::VolumetricModel& model) {
  // The truth with the rotations of the common tables only: for their tool, and in datum G1.
  const auto &all = m.all.layout(), &layout = t.common.basis.layout();
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.fit_size()));
  U.segment<3>(static_cast<Eigen::Index>(layout.squareness_offset())) = m.truth.tail<3>();
  for (const calib::Table& table : all.tables()) {
    const auto nodes = static_cast<Eigen::Index>(all.node_count(table.motion.axis));
    const Eigen::VectorXd values = m.truth.segment(static_cast<Eigen::Index>(table.offset), nodes);
    if (const auto own = layout.find(table.motion)) {
      U.segment(static_cast<Eigen::Index>(own->offset), nodes) += values;
      continue;
    }
    const Vector3 about = Vector3::Unit(static_cast<Eigen::Index>(direction(table.motion.motion)));
    const Vector3 displacement_m = about.cross(t.common.tool_offset_m);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto translation = layout.find({calib::kAllMotions[k], table.motion.axis});
      U.segment(static_cast<Eigen::Index>(translation->offset), nodes) +=
          displacement_m(static_cast<Eigen::Index>(k)) * values;
    }
  }
  const Eigen::VectorXd truth =
      calib::to_datum(calib::ModelDatum::G1, layout, std::array{t.common.tool_offset_m}, U)
          ->head(model.U().size());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(model.covariance());
  const double least = 1e-9 * eigen.eigenvalues().maxCoeff();
  const Eigen::VectorXd e = eigen.eigenvectors().transpose() * (model.U() - truth);
  double sum = 0.0, count = 0.0;
  for (Eigen::Index k = 0; k < e.size(); ++k) {
    if (eigen.eigenvalues()(k) > least) {
      sum += e(k) * e(k) / eigen.eigenvalues()(k);
      count += 1.0;
    }
  }
  return sum / count;
}

struct SoundParts {
  int machines = 0, refused = 0, at_5_percent = 0;
  double u_m = 0.0, u_of_best_two_m = 0.0, squares = 0.0;
};

void count_sound(SoundParts& s, const TripleMachine& m, const calib::mfb::Plan& plan) {
  const Triple t = joint::triple(m, plan);
  const auto result = calib::joint::identify(t.parts, t.common);
  ++s.machines;
  if (!result->contradictions.empty()) {
    ++s.refused;
    fmt::print("seed {}: {}\n", m.seed, result->contradictions.front());
  }
  s.at_5_percent +=
      calib::joint::identify(t.parts, t.common, {.false_alarm = 0.05})->contradictions.empty() ? 0
                                                                                               : 1;
  const auto model = calib::joint::joint_model(t.parts, t.common);
  double best_m = 1.0;
  const auto contributions = calib::joint::contributions(t.parts, t.common);
  for (const auto& part : *contributions) {
    best_m = std::min(best_m, part.u_without_m.value_or(1.0));
  }
  s.u_m += calib::otf::correction_size(model->model).u_m;
  s.u_of_best_two_m += best_m;
  s.squares += normalised_square(m, t, model->model);
}

bool measure_sound(int machines, unsigned first_seed, const calib::mfb::Plan& plan) {
  SoundParts s;
  for (int i = 0; i < machines; ++i) {
    count_sound(s, joint::triple_machine(first_seed + static_cast<unsigned>(i)), plan);
  }
  const double n = std::max(1, s.machines);
  print_figure("joint, sound run, array and bar", "0 refused", "{} of {} refused", s.refused,
               s.machines);
  print_figure("joint, the same at a test level of 5 %", "at most 5 %", "{:.1f} %",
               100.0 * s.at_5_percent / n);
  print_figure("joint, mean u of V of three parts", "at most that of the best two",
               "{:.3f} um, best two {:.3f} um", 1e6 * s.u_m / n, 1e6 * s.u_of_best_two_m / n);
  print_figure("joint, squared error over stated covariance", "0.95 to 1.10", "{:.3f}",
               s.squares / n);
  return s.refused == 0 && s.u_m <= s.u_of_best_two_m * (1.0 + 1e-9) && s.squares / n >= 0.95 &&
         s.squares / n <= 1.10;
}

}  // namespace

int run_joint_campaign(int machines, int sound, unsigned first_seed) {
  const calib::mfb::Plan plan = mfb::paper_plan();
  const bool found = measure_wrong_lengths(machines, first_seed, plan);
  return measure_sound(sound, first_seed, plan) && found ? 0 : 1;
}

}  // namespace abbe::tests::never_worse

int main(int argc, char** argv) {
  const auto number = [&](int i, int otherwise) {
    return argc > i ? std::atoi(argv[i]) : otherwise;
  };
  return abbe::tests::never_worse::run_joint_campaign(number(1, 200), number(2, 100),
                                                      static_cast<unsigned>(number(3, 1)));
}

#include "abbe/calib/otf/backlash.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "message.hpp"

namespace abbe::calib::otf {
namespace {

/// Calls use(motion, node, parameter) for each difference; `node`: absent for one value per table.
template <class Use>
void for_differences(const Observations& o, Use use) {
  std::size_t parameter = o.layout().model_size();
  for (const Table& table : o.layout().tables()) {
    if (o.basis.travel() == estimation::TravelDependence::Backlash) {
      use(table, std::optional<std::size_t>{}, parameter++);
      continue;
    }
    for (std::size_t i = 0; i < o.layout().node_count(table.motion.axis); ++i) {
      use(table, std::optional(i), parameter++);
    }
  }
}

/// Letters of the axes whose direction of travel is unknown: "Y, Z".
std::string axes_without_travel(const AxisTravel& travel) {
  std::string axes;
  for (const Axis axis : kAllAxes) {
    if (travel[index(axis)] == estimation::Travel::Unknown) {
      axes += message(axes.empty() ? "" : ", ", letter(axis));
    }
  }
  return axes;
}

}  // namespace

std::string label(const Backlash& b) {
  return b.position_m ? message(name(b.motion), " at ", *b.position_m, " m") : name(b.motion);
}

bool estimates_backlash(const Observations& o) {
  return o.basis.travel() != estimation::TravelDependence::None;
}

Result<std::size_t> first_with_backlash(Observations& o) {
  const auto is_known = [](const AxisTravel& travel) {
    return axes_without_travel(travel).empty();
  };
  const auto found = std::find_if(o.travel.begin(), o.travel.end(), is_known);
  const auto first = static_cast<std::size_t>(found - o.travel.begin());
  if (!estimates_backlash(o) || first == 0) {
    return 0;
  }

  if (found == o.travel.end()) {
    return failure(
        ErrorCode::RankDeficient,
        message("backlash: the path does not move ", axes_without_travel(o.travel.back()),
                ": drive a path that moves all axes, or do not estimate backlash"));
  }

  const char* const part = o.mode == Mode::Standstill ? "positions" : "legs";
  o.notes.push_back(message("the ", part, " before ", first,
                            " are not used: ", axes_without_travel(o.travel[first - 1]),
                            " had not moved yet, so the state of the backlash is unknown; begin "
                            "the path with a motion of all axes"));
  return first;
}

estimation::Information with_backlash_prior(estimation::Information data, const Observations& o) {
  for (std::size_t i = o.layout().model_size(); i < o.basis.size(); ++i) {
    data.add_prior(i, 0.0, kUOfBacklash);
  }
  return data;
}

std::vector<Backlash> backlash_of(const Observations& o, const Eigen::VectorXd& U,
                                  const Eigen::MatrixXd& covariance) {
  constexpr double kOfPrior = 0.5;  // three quarters of the information are the data's
  std::vector<Backlash> all;
  if (!estimates_backlash(o)) {
    return all;
  }

  for_differences(o,
                  [&](const Table& table, std::optional<std::size_t> node, std::size_t parameter) {
                    const auto i = static_cast<Eigen::Index>(parameter);
                    Backlash b{table.motion, {}, U(i), std::sqrt(covariance(i, i)), false};
                    b.determined = b.u < kOfPrior * kUOfBacklash;
                    if (node) {
                      b.position_m = o.layout().nodes()[index(table.motion.axis)].nodes_m[*node];
                    }
                    all.push_back(b);
                  });
  return all;
}

std::vector<Backlash> largest_of_tables(std::span<const Backlash> all) {
  std::vector<Backlash> largest;
  for (const Backlash& b : all) {
    if (!b.determined) {
      continue;
    }
    if (largest.empty() || largest.back().motion != b.motion) {
      largest.push_back(b);
    } else if (std::abs(b.value) > std::abs(largest.back().value)) {
      largest.back() = b;
    }
  }
  return largest;
}

std::vector<std::string> notes_on(std::span<const Backlash> all) {
  // Probability that noise alone exceeds it in one of 14 values: 1e-3.
  constexpr double kSure = 4.0;
  std::string found, undetermined;
  for (const Backlash& b : largest_of_tables(all)) {
    if (std::abs(b.value) > kSure * b.u) {
      found += message(found.empty() ? "" : ", ", label(b), " ", 1e6 * b.value,
                       is_rotation(b.motion.motion) ? " urad" : " um");
    }
  }
  for (const Backlash& b : all) {
    if (!b.determined) {
      undetermined += message(undetermined.empty() ? "" : ", ", label(b));
    }
  }

  std::vector<std::string> notes;
  if (!found.empty()) {
    notes.push_back(message("backlash, forward minus backward: ", found,
                            "; the model is the mean of both directions, and half the difference "
                            "is in its uncertainty"));
  }
  if (!undetermined.empty()) {
    notes.push_back(message("backlash that the path does not determine, because an axis moves in ",
                            "one direction only or on too few legs: ", undetermined));
  }
  return notes;
}

Eigen::MatrixXd model_covariance(const Observations& o, const Eigen::VectorXd& U,
                                 const Eigen::MatrixXd& covariance) {
  const auto n = static_cast<Eigen::Index>(o.layout().model_size());
  Eigen::MatrixXd of_model = covariance.topLeftCorner(n, n);
  if (!estimates_backlash(o)) {
    return of_model;
  }

  Eigen::MatrixXd half = Eigen::MatrixXd::Zero(n, 3);  // one column per axis
  for_differences(
      o, [&](const Table& table, std::optional<std::size_t> node, std::size_t parameter) {
        const auto axis = static_cast<Eigen::Index>(index(table.motion.axis));
        const double value = 0.5 * U(static_cast<Eigen::Index>(parameter));
        const std::size_t nodes = o.layout().node_count(table.motion.axis);
        const std::size_t first = table.offset + node.value_or(0), count = node ? 1 : nodes;
        half.col(axis)
            .segment(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(count))
            .setConstant(value);
      });
  of_model += half * half.transpose();
  return of_model;
}

}  // namespace abbe::calib::otf

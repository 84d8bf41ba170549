#include "abbe/calib/model/backlash.hpp"

#include <cmath>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib {

std::string_view backlash_name(TravelDependence backlash) {
  switch (backlash) {
    case TravelDependence::None:
      return "none";
    case TravelDependence::Backlash:
      return "per-table";
    case TravelDependence::Tables:
      return "forward-backward";
  }
  return "";
}

std::optional<TravelDependence> backlash_named(std::string_view text) {
  using enum TravelDependence;
  for (const TravelDependence one : {None, Backlash, Tables}) {
    if (text == backlash_name(one)) {
      return one;
    }
  }
  return std::nullopt;
}

std::string label(const Backlash& b) {
  return b.position_m ? message(name(b.motion), " at ", *b.position_m, " m") : name(b.motion);
}

std::vector<Backlash> listed_differences(const TableBasis& basis, const Eigen::VectorXd& D,
                                         const Eigen::MatrixXd& covariance) {
  constexpr double kOfPrior = 0.5;  // limit of u / kUOfBacklash: three quarters of the information
                                    // then come from the data
  const bool per_node = basis.travel() == TravelDependence::Tables;
  std::vector<Backlash> all;
  for (const Table& table : basis.layout().tables()) {
    const std::vector<double>& nodes_m = basis.layout().nodes()[index(table.motion.axis)].nodes_m;
    for (std::size_t node = 0; node < (per_node ? nodes_m.size() : 1); ++node) {
      const auto i = std::ssize(all);
      Backlash b{table.motion, {}, D(i), std::sqrt(covariance(i, i)), false};
      b.determined = b.u < kOfPrior * kUOfBacklash;
      if (per_node) {
        b.position_m = nodes_m[node];
      }
      all.push_back(b);
    }
  }
  return all;
}

std::vector<Backlash> backlash_of(const VolumetricModel& model) {
  if (model.travel() == nullptr) {
    return {};
  }
  return listed_differences(*model.travel_tables(), model.travel()->D, model.travel()->covariance);
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
  // Noise alone exceeds four standard uncertainties in one of 14 values with a probability of 1e-3.
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
                            "; without the direction of travel the model is the mean of both, and "
                            "half the difference is in its uncertainty"));
  }
  if (!undetermined.empty()) {
    notes.push_back(message("backlash that the path does not determine, because an axis moves in ",
                            "one direction only or on too few legs: ", undetermined));
  }
  return notes;
}

}  // namespace abbe::calib

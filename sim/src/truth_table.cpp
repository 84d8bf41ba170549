#include "abbe/sim/truth_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "csv.hpp"
#include "units.hpp"

namespace abbe::sim {
namespace {

constexpr double kMicro = 1e-6;  // um in m, urad in rad
constexpr std::array<std::string_view, 4> kTruthColumns{"name", "position_mm", "value", "unit"};
constexpr std::string_view kBacklash = ".backlash";

struct Place {
  Axis axis{};
  std::size_t motion = 0;
};

std::optional<Place> place_of(std::string_view name) {
  if (name.size() != 3 || name[0] != 'E') return std::nullopt;
  const std::size_t motion = kMotionLetters.find(name[1]);
  const auto axis = axis_named(name.substr(2));
  if (motion == std::string_view::npos || !axis) return std::nullopt;
  return Place{*axis, motion};
}

std::string_view unit_of(std::size_t motion) {
  return motion < 3 ? "um" : "urad";
}

double* squareness_of(Squareness& s, std::string_view name) {
  if (name == "A0Z") return &s.A0Z_rad;
  if (name == "B0Z") return &s.B0Z_rad;
  if (name == "C0Y") return &s.C0Y_rad;
  return nullptr;
}

/// Collects the rows, then builds the functions: the nodes are complete only at the end of the
/// file.
class TruthReader {
 public:
  TruthReader(const CsvTable& table, TruthMachine into, CsvErrors& errors)
      : table_(table), truth_(std::move(into)), errors_(errors) {
    truth_.squareness = {};
    for (AxisTruth& axis : truth_.axes) {
      axis.error = {};
      axis.backlash = {};
    }
  }

  void read(const CsvRow& row) {
    const auto value = csv_number(table_, row, 2, errors_);
    const std::string_view name = row.cells[0];
    if (double* square = squareness_of(truth_.squareness, name)) {
      expect_unit(row, "urad");
      *square = value.value_or(0.0) * kMicro;
      return;
    }

    const bool backlash = name.ends_with(kBacklash);
    const auto place = place_of(backlash ? name.substr(0, name.size() - kBacklash.size()) : name);
    if (!place)
      return errors_.add(row.line,
                         fmt::format("column name: \"{}\" is not an error of this machine", name));
    expect_unit(row, unit_of(place->motion));

    if (backlash) {
      truth_.axis(place->axis).backlash[place->motion] = value.value_or(0.0) * kMicro;
      return;
    }

    const auto position = csv_number(table_, row, 1, errors_);
    if (position && value) add_node(row, *place, *position * kMPerMm, *value * kMicro);
  }

  TruthMachine finish(Shape shape) {
    for (const Axis axis : kAxes) {
      for (std::size_t m = 0; m < kMotions; ++m) {
        Nodes& nodes = nodes_[static_cast<std::size_t>(axis)][m];
        if (nodes.at_m.empty()) continue;
        if (nodes.at_m.size() < 2) {
          errors_.add(nodes.line, motion_name(m, axis) + " needs at least two nodes");
          continue;
        }
        truth_.axis(axis).error[m] =
            ErrorFunction(std::move(nodes.at_m), std::move(nodes.value), shape);
      }
    }

    return std::move(truth_);
  }

 private:
  struct Nodes {
    std::vector<double> at_m, value;
    std::size_t line = 0;
  };

  void expect_unit(const CsvRow& row, std::string_view unit) {
    if (row.cells[3] != unit) {
      errors_.add(row.line,
                  fmt::format("column unit: \"{}\" instead of \"{}\"", row.cells[3], unit));
    }
  }
  void add_node(const CsvRow& row, Place place, double at_m, double value) {
    Nodes& nodes = nodes_[static_cast<std::size_t>(place.axis)][place.motion];
    if (!nodes.at_m.empty() && at_m <= nodes.at_m.back()) {
      return errors_.add(row.line, "column position_mm: nodes of one error must ascend");
    }
    nodes.line = row.line;
    nodes.at_m.push_back(at_m);
    nodes.value.push_back(value);
  }

  const CsvTable& table_;
  TruthMachine truth_;
  CsvErrors& errors_;
  std::array<std::array<Nodes, kMotions>, 3> nodes_;
};

}  // namespace

Result<TruthMachine> parse_truth_csv(std::string_view text, std::string_view name,
                                     TruthMachine into, Shape shape) {
  CsvErrors errors(name);
  const CsvTable table = split_csv(text, errors);
  if (!std::equal(table.header.begin(), table.header.end(), kTruthColumns.begin(),
                  kTruthColumns.end())) {
    errors.add(1, "the header must be name,position_mm,value,unit");
    return tl::unexpected(errors.error());
  }
  TruthReader reader(table, std::move(into), errors);
  for (const CsvRow& row : table.rows) reader.read(row);
  TruthMachine truth = reader.finish(shape);
  if (errors.any()) return tl::unexpected(errors.error());
  return truth;
}

std::string format_truth_csv(const TruthMachine& truth) {
  std::string out = "name,position_mm,value,unit\n";
  const auto row = [&](std::string_view name, double at_m, double value, std::string_view unit) {
    fmt::format_to(std::back_inserter(out), "{},{:.17g},{:.17g},{}\n", name, at_m / kMPerMm,
                   value / kMicro, unit);
  };

  for (const Axis axis : kAxes) {
    for (std::size_t m = 0; m < kMotions; ++m) {
      const ErrorFunction& f = truth.axis(axis).error[m];
      for (std::size_t i = 0; i < f.nodes_m().size(); ++i) {
        row(motion_name(m, axis), f.nodes_m()[i], f.values()[i], unit_of(m));
      }
      const double backlash = truth.axis(axis).backlash[m];
      if (backlash != 0.0)
        row(motion_name(m, axis) + std::string(kBacklash), 0.0, backlash, unit_of(m));
    }
  }

  row("A0Z", 0.0, truth.squareness.A0Z_rad, "urad");
  row("B0Z", 0.0, truth.squareness.B0Z_rad, "urad");
  row("C0Y", 0.0, truth.squareness.C0Y_rad, "urad");

  return out;
}

}  // namespace abbe::sim

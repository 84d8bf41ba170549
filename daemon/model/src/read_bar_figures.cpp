#include "read_bar_figures.hpp"

#include <string>
#include <vector>

namespace abbe::daemon {
namespace {

/// The elements of an array; empty after a fault.
std::vector<const ModelJson*> elements_of(ModelReader& in, const ModelJson& object,
                                          const std::string& path, const std::string& key) {
  std::vector<const ModelJson*> elements;
  const ModelJson* list = in.find(object, path, key);
  if (list != nullptr && !list->is_array()) in.fault(path + "." + key, "must be an array");
  if (list != nullptr && list->is_array())
    for (const ModelJson& element : *list) elements.push_back(&element);
  return elements;
}

}  // namespace

std::optional<BarFigures> read_bar_figures(ModelReader& in) {
  const std::string path = "statistics", passes = "measurements";
  const ModelJson* statistics =
      in.root().is_object() && in.root().contains(path) ? &in.root().at(path) : nullptr;
  if (statistics == nullptr || !statistics->is_object() || !statistics->contains(passes))
    return std::nullopt;
  BarFigures bar;

  for (const ModelJson* pass : elements_of(in, *statistics, path, passes))
    bar.passes.push_back({in.text_of(*pass, path + "." + passes, "name"),
                          in.number_of(*pass, path + "." + passes, "chi2_per_dof", 0)});
  const std::string drift = path + ".drift_um_per_pass", aside = path + ".set_aside";
  for (const ModelJson* d : elements_of(in, *statistics, path, "drift_um_per_pass"))
    bar.drift.push_back({in.text_of(*d, drift, "forward"), in.text_of(*d, drift, "backward"),
                         in.vector_um(*d, drift, "value"), in.vector_um(*d, drift, "u")});
  for (const ModelJson* t : elements_of(in, *statistics, path, "set_aside"))
    bar.set_aside.push_back({.measurement = in.text_of(*t, aside, "measurement"),
                             .feature = in.text_of(*t, aside, "feature"),
                             .side = in.text_of(*t, aside, "side"),
                             .index = in.count_of(*t, aside, "index"),
                             .k = in.count_of(*t, aside, "k"),
                             .residual_m = in.number_of(*t, aside, "residual_um", kMicroUnit)});
  return bar;
}

}  // namespace abbe::daemon

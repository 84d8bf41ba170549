#pragma once
/// Single changes of a configuration: every key of a text, one after the other, with another value.

#include <toml++/toml.h>

#include <functional>
#include <map>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace abbe::daemon::configuration_changes {

/// A value: `set` replaces it.
struct Leaf {
  std::string key;  ///< "encoder.nodes[0].tpdo"
  toml::node* value = nullptr;
  std::function<void(const toml::node&)> set;
};

inline void collect(toml::table& table, const std::string& path, std::vector<Leaf>& out) {
  for (auto&& [name, node] : table) {
    const std::string key =
        path.empty() ? std::string{name.str()} : path + "." + std::string{name.str()};
    if (auto* below = node.as_table()) {
      collect(*below, key, out);
    } else if (auto* list = node.as_array(); list != nullptr && list->is_array_of_tables()) {
      std::size_t index = 0;
      for (auto&& element : *list)
        collect(*element.as_table(), key + "[" + std::to_string(index++) + "]", out);
    } else {
      out.push_back(
          {key, &node, [&table, inner = std::string{name.str()}](const toml::node& value) {
             value.visit([&](const auto& v) { table.insert_or_assign(inner, v); });
           }});
    }
  }
}

inline toml::table parsed(const std::string& text) {
  return toml::parse(text);
}

/// Another value of the same type; an array has another last element. Empty for other types.
inline toml::table another(const toml::node& value) {
  toml::table out;
  if (const auto* flag = value.as_boolean()) out.insert("v", !flag->get());
  if (const auto* whole = value.as_integer()) out.insert("v", whole->get() + 1);
  if (const auto* number = value.as_floating_point())
    out.insert("v", number->get() == 0.0 ? 0.5 : 1.01 * number->get());
  if (const auto* text = value.as_string()) out.insert("v", text->get() + "x");
  if (const auto* list = value.as_array(); list != nullptr && !list->empty()) {
    toml::array changed = *list;
    const toml::table last = another(changed.back());
    changed.pop_back();
    last.get("v")->visit([&changed](const auto& v) { changed.push_back(v); });
    out.insert("v", changed);
  }
  return out;
}

/// Without indices and names of axes: "encoder.nodes.tpdo", "axes.min_mm". Devices of the
/// environment keep their index.
inline std::string general(const std::string& key) {
  if (key.starts_with("environment[")) return key;
  const std::string unnamed = std::regex_replace(key, std::regex{"^axes\\.[A-Z]\\."}, "axes.");
  return std::regex_replace(unnamed, std::regex{"\\[[0-9]+\\]"}, "");
}

struct Change {
  std::string key;
  std::string text;  ///< of the whole changed configuration
};

/// `values`: TOML of the other value of keys for which another one of the same type is not valid;
/// an empty text: the key is not changed.
inline std::vector<Change> single_changes(const std::string& text,
                                          const std::map<std::string, std::string>& values) {
  std::vector<Change> changes;
  toml::table table = parsed(text);
  std::vector<Leaf> leaves;
  collect(table, "", leaves);

  for (std::size_t i = 0; i < leaves.size(); ++i) {
    toml::table changed = parsed(text);
    std::vector<Leaf> all;
    collect(changed, "", all);
    const auto given = values.find(general(all[i].key));
    if (given != values.end() && given->second.empty()) continue;
    const toml::table value =
        given == values.end() ? another(*all[i].value) : parsed("v = " + given->second);
    if (!value.contains("v")) throw std::runtime_error(all[i].key + ": needs another value");
    all[i].set(*value.get("v"));
    std::ostringstream out;
    out << changed;
    changes.push_back({all[i].key, out.str()});
  }
  return changes;
}

}  // namespace abbe::daemon::configuration_changes

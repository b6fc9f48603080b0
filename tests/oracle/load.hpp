#pragma once
// MuJoCo as the oracle: a model and its data, freed at the end. Visual mesh geoms (and the meshes) are left out of the text, as
// --skip-visuals does.
#include <mujoco/mujoco.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>

namespace gsp_test {

struct Oracle {
  std::unique_ptr<mjModel, void (*)(mjModel*)> model{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, void (*)(mjData*)> data{nullptr, mj_deleteData};
  mjModel* m() const { return model.get(); }
  mjData* d() const { return data.get(); }
};

/// The text of a file without the lines that hold a mesh (assets, and geoms that are drawn only).
inline std::string without_meshes(std::filesystem::path const& path) {
  std::ifstream file(path);
  std::string text, line;
  while (std::getline(file, line)) {
    bool const mesh =
        line.find("<mesh ") != std::string::npos || (line.find("<geom") != std::string::npos && line.find("mesh=") != std::string::npos);
    if (!mesh) text += line + "\n";
  }
  return text;
}

inline Oracle load_oracle(std::filesystem::path const& path, std::string const& text = {}) {
  char error[1000] = "";
  mju_user_warning = [](char const*) {};  // no log file beside the test
  Oracle o;
  if (text.empty()) {
    o.model.reset(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  } else {
    auto const vfs = std::make_unique<mjVFS>();
    mj_defaultVFS(vfs.get());
    mj_addBufferVFS(vfs.get(), "model.xml", text.data(), int(text.size()));
    o.model.reset(mj_loadXML("model.xml", vfs.get(), error, sizeof error));
    mj_deleteVFS(vfs.get());
  }
  if (!o.model) throw std::runtime_error(path.string() + ": " + error);
  o.data.reset(mj_makeData(o.m()));
  return o;
}

}  // namespace gsp_test

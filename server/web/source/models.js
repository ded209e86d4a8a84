// Robots' models in force, each requested once, for the battery's capacity, which the live state does not
// contain.
import { forget, getOnce, idPath, useRead } from './api.js';
import { useLive } from './live.js';

const pathOf = (id) => `/v1/robots/${idPath(id)}`;
const none = new Map();

export const forgetModel = (id) => forget(pathOf(id));

const readModels = (ids) =>
  Promise.all(
    ids.map((id) =>
      getOnce(pathOf(id)).then(
        ({ model }) => [id, model],
        () => null,
      ),
    ),
  ).then((models) => new Map(models.filter(Boolean)));

// Map from robot to its model; a robot is absent until its model is read, and without a model.
export function useModels(ids) {
  const live = useLive();
  const wanted = [...new Set(ids)].filter((id) => live.robots.get(id)?.state.has_model).sort();
  return useRead(() => readModels(wanted), wanted.join('\n')).value ?? none;
}

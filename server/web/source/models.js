// Robots' models in force, each requested once, for the battery's capacity, which the live state does not
// contain.
import { useEffect, useState } from 'preact/hooks';
import { get, idPath } from './api.js';
import { useLive } from './live.js';

const asked = new Map();

function modelOf(id) {
  if (!asked.has(id))
    asked.set(
      id,
      get(`/v1/robots/${idPath(id)}`).then(
        ({ model }) => model,
        () => {
          asked.delete(id);
          return null;
        },
      ),
    );
  return asked.get(id);
}

export const forgetModel = (id) => asked.delete(id);

// Map from robot to its model; a robot is absent until its model is read, and without a model.
export function useModels(ids) {
  const live = useLive();
  const [models, setModels] = useState(new Map());
  const wanted = [...new Set(ids)].filter((id) => live.robots.get(id)?.state.has_model).sort();
  useEffect(() => {
    let current = true;
    Promise.all(wanted.map(async (id) => [id, await modelOf(id)])).then((read) => {
      if (current) setModels(new Map(read.filter(([, model]) => model !== null)));
    });
    return () => {
      current = false;
    };
  }, [wanted.join('\n')]);
  return models;
}

// A client with the types of schemas/openapi.json, as a scheduler in TypeScript would have.
import createClient from 'openapi-fetch';
import type { components, paths } from './openapi.js';

type Profile = components['schemas']['profile'];

function must(holds: boolean, what: string): void {
  if (!holds) throw new Error(what);
}

const [baseUrl, robotFile] = [process.argv[2]!, process.argv[3]!];
const robot: components['schemas']['robot'] = JSON.parse(robotFile);
// Some answers are also served as CSV; this client reads JSON.
const client = createClient<paths, 'application/json' | 'application/problem+json'>({ baseUrl });
const id = robot.robot_id;

const put = await client.PUT('/v1/robots/{id}', { params: { path: { id } }, body: robot });
must(put.data?.model_version === 1, `put: ${JSON.stringify(put.error)}`);

const answer = await client.POST('/v1/robots/{id}/profile', {
  params: { path: { id }, query: { digits: 6 } },
  body: { path: [{ kind: 'straight', length_m: 10 }], deadline_s: 30 },
});
const profile: Profile | undefined = answer.data;
must(profile !== undefined && profile.energy_j > 0 && profile.duration_s <= 30.001, 'a profile');
must(String(profile!.energy_j).replace('.', '').length <= 6, `six digits: ${profile!.energy_j}`);

const refused = await client.POST('/v1/robots/{id}/profile', {
  params: { path: { id } },
  body: { path: [{ kind: 'straight', length_m: 10 }], deadline_s: 0.01 },
});
must(
  refused.response.status === 422 && refused.error?.field === '/deadline_s',
  'a problem that names its field',
);

const fleet = await client.GET('/v1/robots', { params: { query: { limit: 5 } } });
must(fleet.data?.robots.some((each) => each.robot_id === id) === true, 'the fleet');

const missions = await client.GET('/v1/missions', { params: { query: { sort: 'ratio', order: 'asc' } } });
must(missions.data?.missions.length === 0 && missions.data.next_cursor === null, 'no missions');

const matrix = await client.POST('/v1/energy-matrix', {
  body: {
    robots: [{ robot_id: id, pose: { x_m: 0, y_m: 0 }, state_of_charge: 0.9 }],
    tasks: [{ task_id: 'fetch', pickup: { x_m: 5, y_m: 2 }, dropoff: { x_m: 3, y_m: 9 } }],
  },
});
must((matrix.data?.rows[0]?.energy_j[0] ?? 0) > 0, 'an energy matrix');

// @ts-expect-error: a length is a number
const wrong: components['schemas']['path'][number] = { kind: 'straight', length_m: 'ten' };
must(wrong.kind === 'straight', 'a path that the types refuse');

console.log(`a generated client asked ${baseUrl}: ${profile!.energy_j} J`);
